#pragma once
/// Colour photographs a reference network is fitted to, and the randomly distorted patches it sees of them.

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "src/base/rng.h"

namespace cnerf {

/// Lab over black, interleaved [H, W, 3]; a and b are no numbers where half of a pixel is transparent.
struct LabImage {
  int width = 0, height = 0;
  std::vector<float> lab;
};

/// A photograph at decreasing sizes, each half of the one before; the largest has a short side of at most
/// `kReferenceShortSide` pixels.
struct ReferenceImage {
  std::vector<LabImage> levels;

  /// Whose pixels are counted.
  [[nodiscard]] const LabImage& counted() const { return levels[std::min<std::size_t>(1, levels.size() - 1)]; }
};
inline constexpr int kReferenceShortSide = 640;

/// @throws MissingInputError, InputError  also when the photograph is monochrome or transparent.
[[nodiscard]] ReferenceImage load_reference_image(const std::filesystem::path& file);

/// How far a training patch may be from the photograph.
struct PatchDistortion {
  double share_min = 0.2, share_max = 1.0;  ///< side of the patch as a share of the short side
  double rotation = 10;                     ///< degrees, either way
  double stretch = 0.15;                    ///< log of the aspect ratio, either way
  bool flip = true;                         ///< left and right
  double log_gamma = 0.1;                   ///< of lightness, either way
  double contrast = 0.05;                   ///< of lightness, either way
  double blur = 1.0;                        ///< largest Gaussian sigma on lightness, pixels; half of the patches
  double noise = 1.0;                       ///< largest standard deviation on lightness, L* units
};

/// Writes one patch of a random photograph: `lightness` [size, size] in L*, `ab` [2, size, size], no numbers
/// where nothing is known.
void sample_reference_patch(std::span<const ReferenceImage> images, const PatchDistortion& distortion, int size,
                            SequentialRng& rng, std::span<float> lightness, std::span<float> ab);

}  // namespace cnerf
