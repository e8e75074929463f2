#pragma once
/// Patches of query-based colorization (paper, Eq. patch sampling): where they lie, what the colorizer is shown of
/// them, and which of its answer's pixels are trained on.

#include <cstdint>
#include <span>
#include <vector>

#include "src/color/ab_bins.h"
#include "src/colorizer/purify.h"
#include "src/train/luminance/view_cache.h"

namespace cnerf {

/// A square of a cached view, in whole pixels.
struct PatchPlace {
  std::size_t view = 0;
  int left = 0, top = 0, side = 0;
  std::uint64_t index = 0;  ///< that it was drawn by
};

/// Sides of patches, as shares of the view's short side.
struct PatchScale {
  double least = 0, most = 0;
};

/// A random place of such a size; patches reach the borders.
[[nodiscard]] PatchPlace random_patch(std::span<const CachedView> views, std::size_t view, PatchScale scale,
                                      std::uint64_t seed, std::uint64_t index);

/// The place moved and resized by up to a twentieth of its side: nearly the same picture, another question.
[[nodiscard]] PatchPlace near_patch(std::span<const CachedView> views, const PatchPlace& place, std::uint64_t seed,
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

/// A patch that is shown to the colorizer, and what came back.
struct AnsweredPatch {
  PatchPlace place;
  int side = 0;  ///< K
  RenderedPatch shown;
  std::vector<float> ab;              ///< [2, K, K]
  std::vector<float> certainty = {};  ///< [K, K] in (0, 1], `certainty_of`; empty where nothing is known of it

  [[nodiscard]] ColorPatchView view() const { return {side, side, ab, shown.opacity}; }
};

/// What an answer of such a certainty weighs: 1 up to `sure_colors` equally likely colours; beyond, it falls with the
/// square of their number. So what a colorizer guesses gives way to what it knows from another view or a larger patch.
/// @param sure_colors  0 = answers weigh the same
[[nodiscard]] float certainty_weight(float certainty, double sure_colors);

/// Some pixels of the square with the answer's colour and certainty at each (bilinear).
struct PatchPixels {
  std::vector<std::uint32_t> pixels;  ///< y * width + x in the view; only those of some opacity
  std::vector<Ab> colors;
  std::vector<float> certainty;  ///< 1 where the answer says nothing of it
};
[[nodiscard]] PatchPixels pick_pixels(const CachedView& view, const AnsweredPatch& patch, int count, std::uint64_t seed,
                                      std::uint64_t index);

}  // namespace cnerf
