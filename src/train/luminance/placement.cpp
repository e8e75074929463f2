#include "src/train/luminance/placement.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
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
constexpr double kMeetingSpread = 1e-4;     // of optical axes that meet, as in arrangement_of
constexpr float kLeastCoverage = 0.02f;     // of a pixel that shows an object

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

/// Whether the optical axes do, rather than lie beside one another.
bool axes_meet(const Capture& capture) {
  std::vector<WorldRay> axes;
  for (const View& view : capture.views) {
    axes.push_back({view.world_from_camera.translation, normalized(view.world_from_camera.linear.column(2))});
  }
  return nearest_point(axes, kMeetingSpread).has_value();
}

/// Nothing where the cameras look at something before them, and neither source nor points tell more.
std::optional<SceneFrame> place_facing(const Capture& capture, const CameraArrangement& cameras,
                                       const std::vector<SparsePoint>& points) {
  if (capture.depth_range) return place_before(cameras, capture.depth_range->far);
  if (capture.is_bounded_object && axes_meet(capture)) return {};
  if (const auto frame = place_by_points(capture, points)) return frame;
  if (dot(cameras.meeting_point - cameras.eye, cameras.forward) > 0 && axes_meet(capture)) return {};
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

/// The pixels of a picture that show an object, or that are ignored and so may.
class ShownPixels {
 public:
  explicit ShownPixels(const MonoImage& image)
      : width_(image.width), height_(image.height), sums_(std::size_t(width_ + 1) * std::size_t(height_ + 1)) {
    parallel_each(std::size_t(height_), 16, [&](std::size_t row) {  // photographs may lie in a file
      std::uint32_t of_row = 0;
      std::size_t pixel = row * std::size_t(width_);
      for (int x = 0; x < width_; ++x, ++pixel) {
        of_row += image.coverage(pixel) > kLeastCoverage || !image.valid(pixel) ? 1 : 0;
        sums_[index(x + 1, int(row) + 1)] = of_row;
      }
    });
    for (int y = 1; y < height_; ++y) {
      for (int x = 1; x <= width_; ++x) sums_[index(x, y + 1)] += sums_[index(x, y)];
    }
  }
  /// Whether one of them lies in the square window, or the window leaves the picture.
  [[nodiscard]] bool may_show(PixelPosition middle, double radius) const {
    const double left = std::floor(middle.x) - radius, right = std::floor(middle.x) + radius + 1;
    const double top = std::floor(middle.y) - radius, bottom = std::floor(middle.y) + radius + 1;
    if (!(left >= 0 && top >= 0 && right <= width_ && bottom <= height_)) return true;
    const int x0 = int(left), x1 = int(right), y0 = int(top), y1 = int(bottom);
    return sums_[index(x1, y1)] - sums_[index(x0, y1)] != sums_[index(x1, y0)] - sums_[index(x0, y0)];
  }

 private:
  [[nodiscard]] std::size_t index(int x, int y) const {
    return std::size_t(y) * std::size_t(width_ + 1) + std::size_t(x);
  }

  int width_, height_;
  std::vector<std::uint32_t> sums_;  // [height + 1, width + 1] of the pixels above and left
};

constexpr int kHullCells = 64;  // along each axis of the box that a visual hull is looked for in

/// Takes the cells away that a view sees nothing in.  @param kept  [z, y, x]
void carve(const View& view, const Aabbd& box, std::vector<std::uint8_t>& kept) {
  if (view.image.alpha.empty()) return;  // it shows something everywhere
  const ShownPixels shown(view.image);
  const Affined camera_from_world = view.world_from_camera.inverse();
  const Vec3d cell = box.size() / double(kHullCells);
  const double reach = 0.5 * length(cell) * std::max(view.intrinsics.fx, view.intrinsics.fy);  // of its corners
  parallel_tasks(kHullCells, [&](std::size_t z) {
    std::size_t at = z * kHullCells * kHullCells;
    for (int y = 0; y < kHullCells; ++y) {
      for (int x = 0; x < kHullCells; ++x, ++at) {
        if (kept[at] == 0) continue;
        const Vec3d middle = box.min + Vec3d{x * cell.x, y * cell.y, double(z) * cell.z} + cell * 0.5;
        const auto pixel = project(view.intrinsics, camera_from_world.point(middle));
        if (!pixel) continue;
        const double distance = length(middle - view.world_from_camera.translation);
        const double radius = 1 + std::floor(reach / distance);
        if (!shown.may_show(*pixel, radius)) kept[at] = 0;
      }
    }
  });
}

/// Bounds of what no view to train on sees as fully transparent (the visual hull), on a coarse grid over `box`.
Aabbd visual_hull_bounds(const Capture& capture, const Aabbd& box) {
  std::vector<std::uint8_t> kept(std::size_t(kHullCells) * kHullCells * kHullCells, 1);
  for (const View& view : capture.views) {
    if (!view.held_out) carve(view, box, kept);
  }
  Aabbd bounds = Aabbd::empty();
  const Vec3d cell = box.size() / double(kHullCells);
  for (std::size_t i = 0; i < kept.size(); ++i) {
    if (kept[i] == 0) continue;
    const auto x = double(i % kHullCells), y = double(i / kHullCells % kHullCells);
    const auto z = double(i / (kHullCells * kHullCells));
    const Vec3d corner = box.min + Vec3d{x * cell.x, y * cell.y, z * cell.z};
    bounds.grow(corner);
    bounds.grow(corner + cell);
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
  const bool is_finite = std::isfinite(centre.x) && std::isfinite(centre.y) && std::isfinite(centre.z);
  if (read != 3 || std::size_t(used) != text.size() || !is_finite) {
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
