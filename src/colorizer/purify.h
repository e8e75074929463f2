#pragma once
/// Histogram-guided purification of a colorizer's answers (paper, Eq. histcomparison and bigh module).
///
/// The paper leaves its histogram open. Ours is a 2-D histogram of ab, weighted by opacity, without near-neutral
/// pixels: grey is in every picture and would make any two of them similar. How much of a patch is neutral is compared
/// only when there is hardly anything else to compare (see `Purifier::similarity`).

#include <span>
#include <vector>

#include "src/colorizer/purify_options.h"

namespace cnerf {

/// A coloured patch that lives elsewhere.
struct ColorPatchView {
  int height = 0, width = 0;
  std::span<const float> ab;       ///< [2, H, W] Lab a and b
  std::span<const float> opacity;  ///< [H, W] in [0, 1]; empty = opaque
};

/// Colours of one patch as the purification sees them.
struct ColorHistogram {
  std::vector<float> bins;  ///< normalised to sum 1; all 0 when no pixel counts
  double visible = 0;       ///< mean opacity
  double chromatic = 0;     ///< share of the opacity that is not near neutral, in [0, 1]
};

/// Histogram over an ab grid of step 10. A pixel is split over the four nearest bins, so that a colour on the border of
/// two bins does not jump, and the result is smeared by a Gaussian of `kHistogramSmear` ab units: neighbouring bins
/// count as similar. Pixels fade out between chroma 6 and 3.
inline constexpr float kHistogramSmear = 6.0f;
inline constexpr float kNeutralChroma = 3.0f, kChromaticChroma = 6.0f;
[[nodiscard]] ColorHistogram ab_histogram(const ColorPatchView& patch);

/// Of several answers, the one most like the others: their medoid under the similarity below, the first of equals. A
/// base that is an outlier would let all of its like pass, and a base's hue is off by what its answer's is.
/// @throws ContractError  when there is no answer.
[[nodiscard]] std::size_t most_typical(std::span<const ColorPatchView> answers);

/// Compares answers with base patches.
class Purifier {
 public:
  /// @throws ContractError  when there is no base or sizes disagree.
  Purifier(const PurifyOptions& options, std::span<const ColorPatchView> bases);

  /// The highest similarity with a base, in [0, 1]: normalised correlation of the histograms. A patch with almost no
  /// chromatic pixels (below `kFewChromatic`) has no histogram to speak of; the shares of neutral and chromatic pixels
  /// are compared by the same formula instead, blended in so that nothing jumps: a grey answer passes where the bases
  /// are mostly grey and fails where they are not. A patch in which nothing is visible (mean opacity below 1 %) has
  /// similarity 0.
  [[nodiscard]] double similarity(const ColorPatchView& answer) const;

  /// similarity > T; always true when purification is off.
  [[nodiscard]] bool accepts(const ColorPatchView& answer) const;

  static constexpr double kFewChromatic = 0.05;

 private:
  PurifyOptions options_;
  std::vector<ColorHistogram> bases_;
};

}  // namespace cnerf
