#pragma once
/// Chroma of a small picture at the pixels of a large one, whose lightness it follows: joint bilateral upsampling
/// (Kopf et al. 2007, "Joint Bilateral Upsampling"). A pixel's chroma is a mean of the samples around it, each of
/// which counts by its distance in the picture and by its difference in lightness. As a mean it adds no contrast of its
/// own, hence no halos, which the linear models of a guided filter (He et al. 2010) leave where chroma does not follow
/// lightness. Unlike there, a sample has the lightness that belongs to its chroma, not that of the large picture at its
/// place: a rendered edge may lie a little beside the photographed one. Cost: 64 samples a pixel, whatever the sizes.

#include <array>
#include <vector>

#include "src/color/ab_bins.h"

namespace cnerf {

/// Samples on a grid that covers the large picture, [H, W] each.
struct ChromaSamples {
  int width = 0, height = 0;
  std::vector<Ab> ab;
  std::vector<float> lightness;  ///< L* of what has this chroma, as light as the large picture would show it
  std::vector<float> weight;     ///< how far a sample is to be trusted, 0..1; one of 0 is not used
};

/// How much a chroma counts for a pixel whose L* differs by this from its own. It never comes to nothing, as a Gaussian
/// would: where nothing is alike, as on a thin twig, what is least unlike decides.
[[nodiscard]] inline float likeness_by_lightness(float difference) {
  // Differences within a surface, grain included, are about this. Of 2 to 12, with a reach of 2 to 6 samples of a
  // JointUpsampler, these two gave the least error of chroma at full size for held-out and trained views of a capture
  // whose colours are known.
  constexpr float kWithinSurface = 6.0f;
  const float relative = difference / kWithinSurface;
  const float half = 1 / (1 + relative * relative);
  return half * half;
}

class JointUpsampler {
 public:
  /// @param width, height  of the large picture; of the samples' own size, chroma is theirs to the bit
  JointUpsampler(const ChromaSamples& samples, int width, int height);

  /// Chroma of the pixel in a column and a row, whose L* is `lightness`; none where no sample in reach has a weight.
  [[nodiscard]] Ab at(int column, int row, float lightness) const;

 private:
  static constexpr int kReach = 4;          ///< of a sample's influence, in samples
  static constexpr int kTaps = 2 * kReach;  ///< of a pixel, along an axis

  /// The samples of a pixel along an axis, by its column or row.
  struct Taps {
    int first = 0;  ///< in the padded grid
    std::array<float, kTaps> weights{};
  };
  [[nodiscard]] static std::vector<Taps> taps_of(int samples, int pixels);

  int stride_ = 0;  ///< of the padded grid
  bool is_own_size_ = false;
  std::vector<Taps> columns_, rows_;
  std::vector<float> lightness_, weight_, a_, b_;  ///< padded by kReach samples of no weight
};

}  // namespace cnerf
