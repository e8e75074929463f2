#include "src/train/luminance/placement.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/capture/arrangement.h"

namespace cnerf {
namespace {

SceneFrame cube(Vec3d centre, double side, int cascades) {
  return {centre, 1.0 / side, cascades};
}

/// Forward-facing captures: the box reaches from the cameras to behind the far plane. 1.21 times the far distance,
/// centred half-way, holds what a lens of 60 to 70 degrees sees there.
SceneFrame place_forward_facing(const Capture& capture, const CameraArrangement& cameras) {
  const double far = capture.depth_range->far;
  return cube(cameras.eye + cameras.forward * (0.5 * far), 1.21 * far, 2);
}

/// Bounds of what no view sees as fully transparent (the visual hull), on a coarse grid over `box`.
Aabbd visual_hull_bounds(const Capture& capture, const Aabbd& box) {
  constexpr int kCells = 64;
  std::vector<Aabbd> of_slice(kCells, Aabbd::empty());
  const Vec3d cell = box.size() / double(kCells);
  parallel_tasks(kCells, [&](std::size_t z) {
    for (int y = 0; y < kCells; ++y) {
      for (int x = 0; x < kCells; ++x) {
        const Vec3d corner = box.min + Vec3d{x * cell.x, y * cell.y, double(z) * cell.z};
        const Vec3d middle = corner + cell * 0.5;
        const bool inside = std::all_of(capture.views.begin(), capture.views.end(), [&](const View& view) {
          const auto pixel = project(view.intrinsics, view.world_from_camera.inverse().point(middle));
          if (!pixel) return true;
          const int radius =
              1 + int(0.5 * cell.x * view.intrinsics.fx / length(middle - view.world_from_camera.translation));
          for (const int dy : {-radius, 0, radius}) {
            for (const int dx : {-radius, 0, radius}) {
              const int px = int(pixel->x) + dx, py = int(pixel->y) + dy;
              if (px < 0 || py < 0 || px >= view.image.width || py >= view.image.height) return true;
              if (view.image.coverage(std::size_t(py) * view.image.width + px) > 0.02f) return true;
            }
          }
          return false;
        });
        if (!inside) continue;
        of_slice[z].grow(corner);
        of_slice[z].grow(corner + cell);
      }
    }
  });
  Aabbd bounds = Aabbd::empty();
  for (const Aabbd& slice : of_slice) {
    if (slice.min.x > slice.max.x) continue;
    bounds.grow(slice.min);
    bounds.grow(slice.max);
  }
  return bounds;
}

/// Objects with alpha: a cube around the visual hull.
SceneFrame place_object(const Capture& capture, Vec3d focus) {
  double half = 0;
  for (const View& view : capture.views) {
    const double distance = length(view.world_from_camera.translation - focus);
    half = std::max(
        half, distance * 0.5 *
                  std::max(view.intrinsics.width / view.intrinsics.fx, view.intrinsics.height / view.intrinsics.fy));
  }
  const Vec3d reach = {half, half, half};
  const Aabbd hull = visual_hull_bounds(capture, {focus - reach, focus + reach});
  if (hull.min.x > hull.max.x) return cube(focus, 2 * half, 1);
  const Vec3d size = hull.size();
  return cube(hull.centre(), 1.05 * std::max({size.x, size.y, size.z}), 1);
}

/// All else: nested boxes around what the cameras look at, reaching behind the cameras.
SceneFrame place_surroundings(const Capture& capture, Vec3d focus) {
  return cube(focus, 3.0 * mean_distance(capture.views, focus), 3);
}

Vec3d centre_of(const std::string& text) {
  Vec3d centre{};
  int used = 0;
  const int read = std::sscanf(text.c_str(), "%lf,%lf,%lf%n", &centre.x, &centre.y, &centre.z, &used);
  if (read != 3 || std::size_t(used) != text.size()) {
    throw UsageError("stage1.placement.centre: expected x,y,z, got '" + text + "'");
  }
  return centre;
}

}  // namespace

SceneFrame place_scene(const Capture& capture, const PlacementOptions& options) {
  const CameraArrangement cameras = arrangement_of(capture);
  const bool is_before_the_scene = cameras.forward_facing && capture.depth_range;
  SceneFrame frame = is_before_the_scene         ? place_forward_facing(capture, cameras)
                     : capture.is_bounded_object ? place_object(capture, cameras.meeting_point)
                                                 : place_surroundings(capture, cameras.meeting_point);
  if (!options.centre.empty()) frame.world_centre = centre_of(options.centre);
  if (options.cascades > 0) frame.cascades = options.cascades;
  return frame;
}

}  // namespace cnerf
