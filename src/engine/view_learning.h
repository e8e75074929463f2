#pragma once
/// How corrections of views are learned, once for every device.

#include <cstdint>

#include "src/base/host_device.h"
#include "src/optim/adam.h"
#include "src/render/gain_field.h"
#include "src/render/lens_correction.h"
#include "src/render/training_views.h"
#include "src/render/view_correction.h"

namespace cnerf {

inline constexpr std::uint32_t kPoseRayBlock = 16;  ///< rays of a step that teach poses together, or do not

/// What is learned of the training views, and how.
struct ViewLearning {
  int views = 0;   ///< training views; 0: nothing is learned
  int lenses = 0;  ///< that they share; 0: not learned
  bool exposures = false, poses = false;
  bool light = false;  ///< how it differs over each picture (gain_field.h)
  /// Learning rates over that of the field; the lens's in focal lengths at the picture's corner.
  float gain_rate = 0.1f, pose_rate = 0.02f, lens_rate = 0.005f, light_rate = 0.02f;
  /// Weight decay of the light's nodes, in units of the field's learning rate: most of what pictures show is the scene.
  float light_decay = 0.05f;
  /// Poses learn little in so many first steps, while the scene takes shape and its gradients say nothing.
  int pose_warm_up = 512;
  /// Poses learn from the coarser levels of the hash grid, up to so many cells, whose slopes hold for more than the
  /// next pixel (BARF, Lin et al. 2021).
  int finest_pose_cells = 512;
  /// Poses learn from one block of rays of so many, lenses from fewer: they have a few numbers, so a part is enough,
  /// and costs less.
  int pose_blocks = 4, lens_blocks = 16;

  [[nodiscard]] CNERF_HD bool is_on() const { return views > 0; }
  [[nodiscard]] CNERF_HD int lit_views() const { return light ? views : 0; }
  [[nodiscard]] CNERF_HD bool teaches_lens(std::uint32_t ray) const {
    return lenses > 0 && ray / kPoseRayBlock % std::uint32_t(lens_blocks) == 0;
  }
  [[nodiscard]] CNERF_HD bool teaches_camera(std::uint32_t ray) const {
    return teaches_lens(ray) || (poses && ray / kPoseRayBlock % std::uint32_t(pose_blocks) == 0);
  }
  /// How many of the levels, which come coarsest first.
  template <typename Levels>
  [[nodiscard]] int pose_levels(const Levels& levels) const {
    int count = 0;
    for (const auto& level : levels) count += int(level.cells) <= finest_pose_cells ? 1 : 0;
    return count < 1 ? 1 : count;
  }
  /// Adam for poses or lenses.
  /// @param adam  of the field
  /// @param step  counted from 1
  [[nodiscard]] CNERF_HD AdamStep of_cameras(const AdamStep& adam, float rate, long step) const {
    return adam.at_rate(step >= pose_warm_up ? rate : rate * float(step) / float(pose_warm_up));
  }
};

/// Adds what a ray says of its lens.
/// @param camera        with the lens as it is learned by now
/// @param turn          of the view
/// @param direction     of the ray, unit space
/// @param by_direction  the gradient by it
CNERF_HD inline void add_lens_gradient(const UnitCamera& camera, const Intrinsics& given, Vec3f turn, Vec3f direction,
                                       Vec3f by_direction, LensGradient& gradient) {
  const auto in_camera = [&](Vec3f v) {
    const Vec3d unturned = turned(-turn.cast<double>(), v.cast<double>());
    const Mat3d& axes = camera.unit_from_camera;
    return Vec3d{dot(axes.column(0), unturned), dot(axes.column(1), unturned), dot(axes.column(2), unturned)};
  };
  gradient.add(camera.intrinsics, given, in_camera(direction), in_camera(by_direction));
}

/// Adam's moments of a view's correction.
struct ViewMoments {
  ViewCorrection first, second;
};
struct LightMoments {
  GainField first, second;
};
struct LensMoments {
  float first[kLensNumbers] = {}, second[kLensNumbers] = {};
};

/// One step of Adam for one view.
/// @param adam  of the field
CNERF_HD inline void update_view(const ViewLearning& learning, const AdamStep& adam, long step,
                                 const ViewGradient& gradient, ViewMoments& moments, ViewCorrection& view) {
  if (learning.exposures) {
    adam.at_rate(learning.gain_rate)
        .apply(gradient.by_log_gain, moments.first.log_gain, moments.second.log_gain, view.log_gain);
  }
  if (!learning.poses) return;
  const AdamStep of_pose = learning.of_cameras(adam, learning.pose_rate, step);
  const Vec3f by_turn = gradient.by_turn(view.turn);
  for (int axis = 0; axis < 3; ++axis) {
    of_pose.apply(by_turn[axis], moments.first.turn[axis], moments.second.turn[axis], view.turn[axis]);
    of_pose.apply(gradient.by_shift[axis], moments.first.shift[axis], moments.second.shift[axis], view.shift[axis]);
  }
}

/// The same for a node of a view's light.
/// @param adam  of the field
CNERF_HD inline void update_light(const ViewLearning& learning, const AdamStep& adam, int node,
                                  const GainField& gradient, LightMoments& moments, GainField& light) {
  adam.at_rate(learning.light_rate)
      .apply(gradient.log_gain[node], moments.first.log_gain[node], moments.second.log_gain[node], light.log_gain[node],
             adam.kept(learning.light_decay));
}

/// The same for one lens.
/// @param adam  at the lens's rate
CNERF_HD inline void update_lens(const AdamStep& adam, const Intrinsics& given, const LensGradient& gradient,
                                 LensMoments& moments, LensCorrection& lens) {
  float motion[kLensNumbers];
  corner_motions(given, motion);
  float* numbers[kLensNumbers] = {&lens.log_focal, &lens.x, &lens.y, &lens.k1, &lens.k2, &lens.p1, &lens.p2};
  for (int i = 0; i < kLensNumbers; ++i) {
    adam.at_rate(1 / motion[i]).apply(gradient.by[i], moments.first[i], moments.second[i], *numbers[i]);
  }
}

/// What all views have in common says nothing about them: scene and corrections could move together. So the median view
/// keeps its exposure, and on average cameras neither turn nor move, nor draw together.
inline constexpr long kGaugeEvery = 16;  ///< steps

struct ViewGauge {
  float log_gain = 0;
  Vec3f turn, shift, centre;
  float growth = 0;  ///< of the distances to the centre, relative

  /// @param origin  of the view's camera as given, unit space
  CNERF_HD void take_off(Vec3f origin, ViewCorrection& view) const {
    view.log_gain -= log_gain;
    view.turn -= turn;
    view.shift -= shift + growth * (origin - centre);
  }
};

/// Whether as many views are darker as are brighter.  @param v  one of the n views
[[nodiscard]] CNERF_HD inline bool is_median_gain(const ViewCorrection* views, int n, int v) {
  int before = 0;
  for (int other = 0; other < n; ++other) {
    const float difference = views[other].log_gain - views[v].log_gain;
    before += difference < 0 || (difference == 0 && other < v) ? 1 : 0;
  }
  return before == n / 2;
}

/// All of the gauge but the gain.
/// @param origin  (view) -> where its camera was given, unit space
template <typename Origin>
[[nodiscard]] CNERF_HD ViewGauge pose_gauge(const ViewCorrection* views, int n, Origin&& origin) {
  ViewGauge gauge;
  for (int v = 0; v < n; ++v) {
    gauge.turn += views[v].turn / float(n);
    gauge.shift += views[v].shift / float(n);
    gauge.centre += origin(v) / float(n);
  }
  float outwards = 0, spread = 0;
  for (int v = 0; v < n; ++v) {
    const Vec3f arm = origin(v) - gauge.centre;
    outwards += dot(arm, views[v].shift);
    spread += dot(arm, arm);
  }
  if (spread > 0) gauge.growth = outwards / spread;
  return gauge;
}

}  // namespace cnerf
