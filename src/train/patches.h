#pragma once
/// Query-based colorization's patches (paper, Eq. patch sampling): where they lie, what the colorizer is shown of them,
/// and which of its answer's pixels are trained on.

#include <cstdint>
#include <string>
#include <vector>

#include "src/color/ab_bins.h"
#include "src/colorizer/colorizer.h"
#include "src/train/view_cache.h"

namespace cnerf {

/// A square of a cached view, in whole pixels.
struct PatchPlace {
  std::size_t view = 0;
  int left = 0, top = 0, side = 0;
  std::uint64_t index = 0;  ///< that it was drawn by
};

/// A random place whose side is a share in [scale_min, scale_max] of the view's short side; patches reach the borders.
[[nodiscard]] PatchPlace random_patch(const std::vector<CachedView>& views, std::size_t view, double scale_min,
                                      double scale_max, std::uint64_t seed, std::uint64_t index);

/// The place moved and resized by up to a twentieth of its side: nearly the same picture, another question.
[[nodiscard]] PatchPlace near_patch(const std::vector<CachedView>& views, const PatchPlace& place, std::uint64_t seed,
                                    std::uint64_t index);

/// What the colorizer sees: K x K, area-averaged in linear light where the square is wider than that.
struct RenderedPatch {
  std::vector<float> lightness;  ///< [K, K] L* 0..100
  std::vector<float> opacity;    ///< [K, K]
};
[[nodiscard]] RenderedPatch render_patch(const CachedView& view, const PatchPlace& place, int k);

/// The square of a picture with the view's size, resized to [2, K, K].
/// @param ab  [2, H, W]
[[nodiscard]] std::vector<float> patch_colors(const CachedView& view, const PatchPlace& place, int k,
                                              const std::vector<float>& ab);

/// A whole view as a question, its short side at most `short_side` pixels.
[[nodiscard]] LightnessBatch whole_view(const CachedView& view, const std::string& name, std::uint64_t query,
                                        int short_side);
/// The answer to such a question at the view's own size, [2, H, W].
[[nodiscard]] std::vector<float> at_view_size(const CachedView& view, const LightnessBatch& question,
                                              const std::vector<float>& ab);
/// The views in an order in which one might walk past them: from the first one always to the nearest that is left.
[[nodiscard]] std::vector<std::size_t> along_the_path(const std::vector<CachedView>& views);

/// Some pixels of the square with the answer's colour at each (bilinear).
struct PatchPixels {
  std::vector<std::uint32_t> pixels;  ///< y * width + x in the view; only those of some opacity
  std::vector<Ab> colors;
};
/// @param ab  [2, K, K]
[[nodiscard]] PatchPixels pick_pixels(const CachedView& view, const PatchPlace& place, int k,
                                      const std::vector<float>& ab, int count, std::uint64_t seed, std::uint64_t index);

}  // namespace cnerf
