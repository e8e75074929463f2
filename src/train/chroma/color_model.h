#pragma once
/// Stage 2's result in memory: the distribution a pixel decodes from, and the per-sample colour a bake takes.

#include <filesystem>
#include <memory>
#include <string>

#include "src/engine/color_engines.h"
#include "src/engine/engines.h"
#include "src/train/chroma/sky_colors.h"
#include "src/train/chroma/stage2.h"
#include "src/train/luminance/snapshot.h"

namespace cnerf {

/// Where the colours of a take's pixels come from.
enum class PixelColors {
  kDistribution,  ///< the composited distribution over the ab bins, decoded
  kField,         ///< the composited per-sample colour; there is no distribution
};

struct ColorModel {
  Stage2Options options;
  PixelColors pixel_colors = PixelColors::kDistribution;
  std::string kernels, kernels_before;  ///< as LuminanceModel has them
  std::string colorizer;
  std::string stage1_sha256;  ///< of the stage 1 snapshot it belongs to
  Stage2Report report;
  std::vector<std::int64_t> queries = {0};  ///< patches the colorizer was asked for, and the next patch's index
  std::unique_ptr<ColorBinEngine> chroma;
  std::unique_ptr<ColorFieldEngine> chromaticity;
  SkyColors sky;  ///< there is one where stage 1 has a sky

  static ColorModel create(const Stage2Options& options, const Engines& engines);
  /// @throws MissingInputError, SnapshotError
  static ColorModel load(const std::filesystem::path& snapshot, const Engines& engines);
  void save(const std::filesystem::path& snapshot);
  /// One with engines of its own, in the same state.
  [[nodiscard]] ColorModel copy(const Engines& engines);

  /// Colours of pixels as `pixel_colors` says, brought into the gamut at the pixel's own luminance. Pixels of hardly
  /// any opacity are grey.
  [[nodiscard]] std::vector<Ab> decode(const PixelSamples& pixels) const;
  [[nodiscard]] std::vector<Ab> decode(const TracedPixels& pixels) const;

 private:
  [[nodiscard]] std::vector<StatePiece> state();
};

/// ab at a luminance, its chroma reduced until the colour lies in the gamut.
[[nodiscard]] Ab in_gamut(Ab color, float luminance);

/// Linear Y of each pixel, over black.
[[nodiscard]] std::vector<float> pixel_luminance(const PixelSamples& pixels);

}  // namespace cnerf
