#include "src/train/luminance/exclusion.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "src/capture/arrangement.h"

namespace cnerf {
namespace {

constexpr std::ptrdiff_t kAgreeingViews = 3;  // have to see what is in front of what they look at
constexpr std::ptrdiff_t kViewsPerVote = 4;   // of small captures: one of so many has to
constexpr double kNearShare = 0.9;            // of the near bound: it was measured, and not exactly
constexpr double kSurroundedRadii = 2;        // a lens so close to the ball counts as seeing it
constexpr double kConeMargin = 1.2;           // on the ball's radius in the image: lenses are not linear

/// A training view, as seen from unit space.
struct SeeingView {
  Affined camera_from_unit;
  const Intrinsics* lens;
  double widest_cosine;   ///< of the picture's farthest corner; below 0 where it shows what is behind the lens
  double focus_distance;  ///< to what the views look at, world units
};

/// A cell of the occupancy grid, in the axes of a camera; world units.
struct Ball {
  Vec3d centre;
  double radius;
};

/// Whether what the lens sees reaches into the ball.
bool cone_overlaps_ball(const SeeingView& view, const Ball& ball) {
  const double distance = length(ball.centre);
  if (distance < kSurroundedRadii * ball.radius) return true;
  if (view.widest_cosine < 0 && ball.centre.z <= 0) {  // where `project` knows no pixel
    const double off_axis = std::atan2(std::hypot(ball.centre.x, ball.centre.y), ball.centre.z);
    return off_axis - std::asin(ball.radius / distance) < std::acos(view.widest_cosine);
  }
  const Intrinsics& lens = *view.lens;
  const auto pixel = project(lens, ball.centre);
  if (!pixel) return false;
  const double margin = kConeMargin * ball.radius / ball.centre.z * lens.fx;
  return pixel->x >= -margin && pixel->y >= -margin && pixel->x <= lens.width + margin &&
         pixel->y <= lens.height + margin;
}

std::vector<SeeingView> seeing_views(const Capture& capture, const SceneFrame& frame) {
  const Vec3d focus = arrangement_of(capture).meeting_point;
  const Affined world_from_unit = {Mat3d::identity() * (1.0 / frame.unit_per_world), frame.world_from_unit({0, 0, 0})};
  std::vector<SeeingView> views;
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    views.push_back({view.world_from_camera.inverse() * world_from_unit, &view.intrinsics,
                     least_cosine_of(view.intrinsics), length(view.world_from_camera.translation - focus)});
  }
  return views;
}

}  // namespace

void exclude_empty(const Capture& capture, const SceneFrame& frame, const FreeSpace& free_space,
                   LuminanceEngine& engine) {
  const std::vector<SeeingView> views = seeing_views(capture, frame);
  const auto agreeing = std::min(kAgreeingViews, std::ptrdiff_t(views.size()) / kViewsPerVote);
  const double world_per_unit = 1.0 / frame.unit_per_world;
  const double near = capture.depth_range ? kNearShare * capture.depth_range->near : 0.0;
  engine.exclude([&](Vec3f centre, float radius) {
    if (free_space.holds(frame.world_from_unit(centre.cast<double>()), double(radius) * world_per_unit)) return false;
    std::ptrdiff_t seeing_in_front = 0;
    for (const SeeingView& view : views) {
      const Ball ball{view.camera_from_unit.point(centre.cast<double>()), double(radius) * world_per_unit};
      const double depth = view.widest_cosine < 0 ? length(ball.centre) : ball.centre.z;
      if (depth + ball.radius < near || !cone_overlaps_ball(view, ball)) continue;
      const bool is_behind_focus = length(ball.centre) + ball.radius > view.focus_distance;
      if (is_behind_focus || ++seeing_in_front >= agreeing) return true;
    }
    return false;
  });
}

}  // namespace cnerf
