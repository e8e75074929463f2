#include "src/train/luminance/placement.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <vector>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/capture/arrangement.h"

namespace cnerf {
namespace {

SceneFrame cube(Vec3d centre, double side, int cascades) {
  return {centre, 1.0 / side, cascades};
}

constexpr double kLeastSpread = 1e-6;       // of the cameras, in terms of how far from the origin they are
constexpr std::size_t kFewestThatTell = 8;  // that say how far a scene reaches
constexpr double kOutliers = 0.02;          // share of the points that lie behind what was taken
constexpr double kBehindPoints = 1.1;       // surfaces go on behind the last point
constexpr double kUnknownReach = 8;         // of a scene that no point tells of, times the cameras' spread

/// Distance within which nearly all of the scene lies.
/// @param distances  of its points
std::optional<double> reach_of(std::vector<double> distances) {
  if (distances.size() < kFewestThatTell) return {};
  const auto last = distances.begin() + std::ptrdiff_t(double(distances.size() - 1) * (1 - kOutliers));
  std::nth_element(distances.begin(), last, distances.end());
  return kBehindPoints * *last;
}

/// The cameras' greatest distance from their middle.
double spread_of(const Capture& capture, const CameraArrangement& cameras) {
  double spread = 0;
  for (const View& view : capture.views) {
    spread = std::max(spread, length(view.world_from_camera.translation - cameras.eye));
  }
  return spread;
}

/// Forward-facing captures whose points alone tell how far the scene reaches: boxes around these and the cameras.
std::optional<SceneFrame> place_by_points(const Capture& capture, const std::vector<SparsePoint>& points) {
  if (points.size() < kFewestThatTell) return {};
  Aabbd bounds = Aabbd::empty();
  const auto last = std::size_t(double(points.size() - 1) * (1 - kOutliers));
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> along;
    for (const SparsePoint& point : points) along.push_back(point.position[axis]);
    std::ranges::sort(along);
    bounds.min[axis] = along[along.size() - 1 - last];
    bounds.max[axis] = along[last];
  }
  for (const View& view : capture.views) bounds.grow(view.world_from_camera.translation);
  const Vec3d size = bounds.size();
  return cube(bounds.centre(), kBehindPoints * std::max({size.x, size.y, size.z}), 2);
}

/// Forward-facing captures: the box reaches from the cameras to behind the far plane. 1.21 times the far distance,
/// centred half-way, holds what a lens of 60 to 70 degrees sees there.
SceneFrame place_before(const CameraArrangement& cameras, double far) {
  return cube(cameras.eye + cameras.forward * (0.5 * far), 1.21 * far, 2);
}

/// Nothing where the cameras look at something before them, and neither source nor points tell more.
std::optional<SceneFrame> place_facing(const Capture& capture, const CameraArrangement& cameras,
                                       const std::vector<SparsePoint>& points) {
  if (capture.depth_range) return place_before(cameras, capture.depth_range->far);
  if (capture.is_bounded_object) return {};
  if (const auto frame = place_by_points(capture, points)) return frame;
  if (dot(cameras.meeting_point - cameras.eye, cameras.forward) > 0) return {};
  return place_before(cameras, kUnknownReach * spread_of(capture, cameras));
}

/// Cameras that look outward, as from the middle of a room: boxes around them that reach behind its walls.
SceneFrame place_around_cameras(const Capture& capture, const CameraArrangement& cameras,
                                const std::vector<SparsePoint>& points) {
  std::vector<double> distances;
  for (const SparsePoint& point : points) {
    const Vec3d from_eye = point.position - cameras.eye;
    distances.push_back(std::max({std::abs(from_eye.x), std::abs(from_eye.y), std::abs(from_eye.z)}));
  }
  const double spread = spread_of(capture, cameras);
  const double reach = std::max(reach_of(std::move(distances)).value_or(kUnknownReach * spread), 1.5 * spread);
  return cube(cameras.eye, 2 * reach, 3);
}

/// Bounds of what no view to train on sees as fully transparent (the visual hull), on a coarse grid over `box`.
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
          if (view.held_out) return true;
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

SceneFrame place_scene(const Capture& capture, const PlacementOptions& options,
                       const std::vector<SparsePoint>& points) {
  const CameraArrangement cameras = arrangement_of(capture.views, positions_of(points), capture.depth_range);
  if (!(spread_of(capture, cameras) > kLeastSpread * length(cameras.eye))) {
    throw InputError(capture.root, "cameras", "all stand in one place, which tells no depth");
  }
  const std::optional<SceneFrame> facing =
      cameras.forward_facing ? place_facing(capture, cameras, points) : std::nullopt;
  SceneFrame frame = facing                      ? *facing
                     : capture.is_bounded_object ? place_object(capture, cameras.meeting_point)
                     : cameras.outward_looking   ? place_around_cameras(capture, cameras, points)
                                                 : place_surroundings(capture, cameras.meeting_point);
  if (!options.centre.empty()) frame.world_centre = centre_of(options.centre);
  if (options.cascades > 0) frame.cascades = options.cascades;
  return frame;
}

}  // namespace cnerf
