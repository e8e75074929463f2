#pragma once
/// Pictures of a field as it stands in memory, for somebody who moves a camera through it.

#include <functional>
#include <span>
#include <vector>

#include "src/field/finish.h"
#include "src/picture/picture.h"
#include "src/train/chroma/color_model.h"
#include "src/train/luminance/luminance_model.h"

namespace cnerf::studio {

/// What is drawn.
struct FieldCamera {
  Intrinsics lens;
  Affined world_from_camera;
};

/// Colours that a picture shows; null = grey.
using Side = const ColorModel*;

/// What drawing may leave out.
struct DrawingEffort {
  RenderEffort rays;
  int steps_per_box = 0;  ///< of the march; 0 as in training
  /// Pictures of at least so many pixels are traced where their neighbours do not foretell them (sparse_pixels.h);
  /// smaller ones show a scene too coarsely for that. 0: none is.
  std::size_t least_sparse_pixels = 0;
  Finish finish = {};
};

/// What drawing took.
struct DrawingCosts {
  std::size_t rays = 0;          ///< that were traced
  std::size_t colored_rays = 0;  ///< of them those whose colours were decoded
};

/// Of a picture that is looked at: what is left out cannot be seen.
/// @param steps_per_box  as `RenderOptions` has them
[[nodiscard]] inline DrawingEffort sharp_effort(int steps_per_box, const Finish& finish = {}) {
  return {{1e-2f, 0.98f}, steps_per_box, 400 * 200, finish};
}

/// Draws one picture for each side, of the lens's size, all from one march.
/// @param keep_going  asked between parts of the picture
/// @param costs       added to; may be null
/// @return  [sides] 8-bit sRGB over black; empty where it was told to stop
[[nodiscard]] std::vector<Picture> draw_field(const LuminanceModel& luminance, const FieldCamera& camera,
                                              std::span<const Side> sides, const DrawingEffort& effort,
                                              const std::function<bool()>& keep_going, DrawingCosts* costs = nullptr);

/// The same of a cached view, its pixels thinned to a width of at most `width`: for thumbnails.
[[nodiscard]] Picture draw_cached(const CachedView& view, Side side, int width, const Finish& finish);

}  // namespace cnerf::studio
