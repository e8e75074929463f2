#include "src/capture/arrangement.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "src/base/check.h"
#include "src/base/statistics.h"

namespace cnerf {
namespace {

constexpr double kForwardWithin = 30 * std::numbers::pi / 180;  // of an optical axis and the mean of all
constexpr double kLeastSpread = 1e-4;                           // of axes that meet

Vec3d optical_axis(const View& view) {
  return view.world_from_camera.linear.column(2);
}

Vec3d unit_or_zero(Vec3d v) {
  return length(v) > 0 ? normalized(v) : v;
}

/// Distance ahead of the cameras at which most of the scene lies.
double typical_depth(const CameraArrangement& cameras, const std::vector<View>& views, const std::vector<Vec3d>& points,
                     const std::optional<DepthRange>& range) {
  // Depth is perceived by its inverse; LLFF weighs near and far the same way.
  if (range) return 1 / (0.25 / range->near + 0.75 / range->far);
  std::vector<double> depths;
  for (const Vec3d& point : points) {
    const double depth = dot(point - cameras.eye, cameras.forward);
    if (depth > 0) depths.push_back(depth);
  }
  if (!depths.empty()) return median(std::move(depths));
  double spread = 0;
  for (const View& view : views) spread = std::max(spread, length(view.world_from_camera.translation - cameras.eye));
  return 4 * spread;
}

}  // namespace

std::optional<Vec3d> nearest_point(const std::vector<WorldRay>& rays, double least_spread) {
  Mat3d normal{};
  Vec3d right{};
  for (const auto& [origin, d] : rays) {
    for (int i = 0; i < 3; ++i) {
      Vec3d row{};
      for (int j = 0; j < 3; ++j) row[j] = (i == j ? 1.0 : 0.0) - d[i] * d[j];
      normal.rows[i] += row;
      right[i] += dot(row, origin);
    }
  }
  if (!(normal.determinant() >= least_spread * std::pow(double(rays.size()), 3))) return std::nullopt;
  return normal.inverse() * right;
}

CameraArrangement arrangement_of(const std::vector<View>& views, const std::vector<Vec3d>& points,
                                 const std::optional<DepthRange>& depth_range) {
  CNERF_CHECK(!views.empty(), "an arrangement has cameras");
  CameraArrangement out;
  std::vector<WorldRay> axes;
  Vec3d mean_axis{}, unit_axis{}, tops{};
  const double count = double(views.size());
  for (const View& view : views) {
    axes.push_back({view.world_from_camera.translation, normalized(optical_axis(view))});
    out.eye += axes.back().origin / count;
    mean_axis += optical_axis(view) / count;
    unit_axis += axes.back().direction / count;
    tops += -view.world_from_camera.linear.column(1) / count;
  }
  out.forward = unit_or_zero(mean_axis);
  out.up = unit_or_zero(tops);
  out.forward_facing = std::ranges::all_of(
      axes, [&](const WorldRay& axis) { return dot(axis.direction, out.forward) > std::cos(kForwardWithin); });
  out.meeting_point = nearest_point(axes, kLeastSpread).value_or(out.eye + unit_axis);
  const auto looks_away = [&](const WorldRay& axis) {
    return dot(out.meeting_point - axis.origin, axis.direction) <= 0;
  };
  out.outward_looking = !out.forward_facing && 2 * std::ranges::count_if(axes, looks_away) > std::ssize(axes);
  out.focus =
      out.forward_facing ? out.eye + out.forward * typical_depth(out, views, points, depth_range) : out.meeting_point;
  return out;
}

double mean_distance(const std::vector<View>& views, Vec3d point) {
  double total = 0;
  for (const View& view : views) total += length(view.world_from_camera.translation - point);
  return total / double(views.size());
}

}  // namespace cnerf
