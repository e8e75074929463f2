#pragma once
/// Captures made worse in known ways, for measuring what training makes good again.

#include <cmath>
#include <numbers>
#include <vector>

#include "src/base/aabb.h"
#include "src/base/rng.h"
#include "src/capture/capture.h"
#include "src/render/view_correction.h"

namespace cnerf::test {

struct Disturbance {
  double gain = 0;     ///< light of each view, held-out ones too: uniform within this share of 1
  double degrees = 0;  ///< training poses: standard deviation of the angle about a random axis
  double shift = 0;    ///< training poses: standard deviation along each axis, over the diagonal of the cameras' box
  double focal = 0;    ///< all lenses: focal length too long by this share, and distortion forgotten
};

inline Vec3d normal_vector(SequentialRng& rng) {
  const double x = rng.normal(), y = rng.normal(), z = rng.normal();
  return {x, y, z};
}

/// Of all training views.
inline std::vector<Affined> training_poses(const Capture& capture) {
  std::vector<Affined> poses;
  for (const View& view : capture.views) {
    if (!view.held_out) poses.push_back(view.world_from_camera);
  }
  return poses;
}

inline void disturb(Capture& capture, const Disturbance& by) {
  SequentialRng rng(1, named_stream("worse"));
  Aabbd box = Aabbd::empty();
  for (const View& view : capture.views) box.grow(view.world_from_camera.translation);
  const double size = length(box.size());
  for (View& view : capture.views) {
    if (by.focal != 0) {
      Intrinsics& lens = view.intrinsics;
      lens.fx *= 1 + by.focal;
      lens.fy *= 1 + by.focal;
      if (lens.model == LensModel::kOpenCv)
        lens = {LensModel::kPinhole, lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy, {}};
    }
    view.image.exposure /= 1 + float(by.gain) * rng.uniform(-1, 1);
    const Vec3d axis = normalized(normal_vector(rng)), shift = normal_vector(rng);
    const Vec3d turn = axis * (by.degrees * rng.normal() * std::numbers::pi / 180);
    if (view.held_out) continue;
    Affined& pose = view.world_from_camera;
    pose.linear = Mat3d::from_columns(turned(turn, pose.linear.column(0)), turned(turn, pose.linear.column(1)),
                                      turned(turn, pose.linear.column(2)));
    pose.translation += by.shift * size * shift;
  }
}

}  // namespace cnerf::test
