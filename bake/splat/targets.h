#pragma once
/// The pictures that splats are to look like: the field's own, from the training cameras and from between them.

#include <cstdint>
#include <functional>
#include <vector>

#include "bake/camera.h"
#include "bake/splat/splat_math.h"

namespace cnerf::bake {

/// What the field shows a camera.
struct FieldPicture {
  std::vector<float> rgb;      ///< [H, W, 3] linear Rec.709 over black
  std::vector<float> opacity;  ///< [H, W]
  std::vector<float> depth;    ///< [H, W] along the optical axis, world units; 0 where nothing is
};
using DrawField = std::function<FieldPicture(const Intrinsics&, const Affined& world_from_camera)>;

struct SplatTarget {
  Intrinsics intrinsics;  ///< without lens distortion
  Affined world_from_camera;
  double blur = 0;                 ///< of viewers, in this picture's square pixels
  std::vector<std::uint8_t> rgba;  ///< [H, W, 4] sRGB-encoded over black; opacity
  std::vector<float> depth;        ///< [H, W] as FieldPicture

  [[nodiscard]] std::size_t pixels() const { return depth.size(); }
  /// World point that a pixel shows.
  [[nodiscard]] Vec3d point(int x, int y, double depth_there) const;
  /// Side of a pixel there, world units.
  [[nodiscard]] double footprint(double depth_there) const { return depth_there / intrinsics.fx; }
};

/// The camera of a picture of at most `side` pixels, without lens distortion.
[[nodiscard]] Intrinsics reduced_pinhole(const Intrinsics& intrinsics, int side);

/// The cameras, then one between each of them and the nearest other that looks into about the same direction, without
/// those twice. Of more than a few hundred cameras, some.
[[nodiscard]] std::vector<Camera> target_cameras(const std::vector<Camera>& cameras);

/// One picture for each camera. Pictures are reduced by leaving out pixels, and each begins with another one, so that
/// all of them together show what lies between the pixels of one.
/// @param side  pixels of the long side, at most
/// @throws Interrupted  between two pictures
[[nodiscard]] std::vector<SplatTarget> draw_targets(const std::vector<Camera>& cameras, const DrawField& draw, int side,
                                                    const std::function<void(double)>& advance);

}  // namespace cnerf::bake
