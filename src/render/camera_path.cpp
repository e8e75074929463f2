#include "src/render/camera_path.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include "src/base/error.h"
#include "src/base/statistics.h"
#include "src/capture/arrangement.h"
#include "src/capture/picture_names.h"

namespace cnerf {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;
constexpr double kOpenGap = kTwoPi / 3;  // an arc without cameras wider than this is not flown through

Vec3d position_of(const View& view) {
  return view.world_from_camera.translation;
}
/// A pinhole of the first view's field of view, at the size the configuration asks for, even for video codecs.
Intrinsics path_intrinsics(const Capture& capture, const PictureOptions& config) {
  const Intrinsics& source = capture.views.front().intrinsics;
  const double scale = std::min(1.0, double(config.short_side) / std::min(source.width, source.height));
  const auto even = [&](int side) { return std::max(2, 2 * int(std::lround(side * scale / 2))); };
  Intrinsics result;
  result.width = even(source.width);
  result.height = even(source.height);
  result.fx = source.fx * result.width / source.width;
  result.fy = source.fy * result.height / source.height;
  result.cx = result.width / 2.0;
  result.cy = result.height / 2.0;
  return result;
}

/// Cameras about an axis: angle, distance from it and height along it.
struct Cylinder {
  Vec3d centre, up, east, north;

  [[nodiscard]] double angle(Vec3d p) const { return std::atan2(dot(p - centre, north), dot(p - centre, east)); }
  [[nodiscard]] double height(Vec3d p) const { return dot(p - centre, up); }
  [[nodiscard]] double radius(Vec3d p) const { return std::hypot(dot(p - centre, north), dot(p - centre, east)); }
  [[nodiscard]] Vec3d point(double angle_, double radius_, double height_) const {
    return centre + east * (radius_ * std::cos(angle_)) + north * (radius_ * std::sin(angle_)) + up * height_;
  }
};

Cylinder cylinder_about(Vec3d centre, Vec3d up) {
  const Vec3d any = std::abs(up.x) < 0.9 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  const Vec3d east = normalized(cross(any, up));
  return {centre, up, east, cross(up, east)};
}

/// The part of the circle that cameras cover.
struct Arc {
  double begin = 0, length = kTwoPi;
  [[nodiscard]] bool is_closed() const { return length >= kTwoPi - kOpenGap; }
};

Arc covered_arc(std::vector<double> angles) {
  std::ranges::sort(angles);
  Arc arc{angles.front(), 0};
  double widest = angles.front() + kTwoPi - angles.back();
  for (std::size_t i = 1; i < angles.size(); ++i) {
    if (angles[i] - angles[i - 1] > widest) {
      widest = angles[i] - angles[i - 1];
      arc.begin = angles[i];
    }
  }
  arc.length = kTwoPi - widest;
  return arc;
}

/// Angle of frame `index` of `count`: once around, or to and fro, slowest at the ends.
double angle_on(const Arc& arc, int index, int count) {
  if (arc.is_closed()) return arc.begin + kTwoPi * index / count;
  const int there = std::min(index, count - index);  // the way back to the last bit
  return arc.begin + arc.length * 0.5 * (1 - std::cos(kTwoPi * there / count));
}

constexpr std::string_view kFrame = "frame_";

std::string frame_name(int index) {
  return fmt::format("{}{:04}", kFrame, index);
}

}  // namespace

Affined look_at(Vec3d position, Vec3d target, Vec3d up) {
  const Vec3d forward = normalized(target - position);
  const Vec3d right = normalized(cross(forward, up));
  return {Mat3d::from_columns(right, cross(forward, right), forward), position};
}

bool is_frame_name(const std::string& name) {
  return name.starts_with(kFrame) && name.find_first_not_of("0123456789", kFrame.size()) == std::string::npos;
}

std::vector<std::vector<std::size_t>> frames_of_equal_cameras(const CameraPath& path) {
  std::vector<std::vector<std::size_t>> frames;
  for (std::size_t i = 0; i < path.cameras.size(); ++i) {
    const PathCamera& camera = path.cameras[i];
    const auto same = std::ranges::find_if(frames, [&](const std::vector<std::size_t>& seen) {
      const PathCamera& other = path.cameras[seen.front()];
      return other.world_from_camera == camera.world_from_camera && other.intrinsics == camera.intrinsics;
    });
    if (same == frames.end()) {
      frames.push_back({i});
    } else {
      same->push_back(i);
    }
  }
  return frames;
}

CameraPath spiral_path(const Capture& capture, const PictureOptions& config) {
  const CameraArrangement cameras = arrangement_of(capture);
  const Vec3d eye = cameras.eye, focus = cameras.focus, up = cameras.up;
  const Mat3d axes = look_at(eye, focus, up).linear;
  Vec3d reach{};
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> offsets;
    for (const View& view : capture.views) offsets.push_back(std::abs(dot(position_of(view) - eye, axes.column(axis))));
    reach[axis] = 0.7 * quantile(offsets, 0.9);  // stay well inside what was photographed
  }
  CameraPath path{"spiral", {}};
  const Intrinsics intrinsics = path_intrinsics(capture, config);
  for (int i = 0; i < config.frames; ++i) {
    const double angle = kTwoPi * i / config.frames;
    const Vec3d offset = {reach.x * std::cos(angle), reach.y * std::sin(angle), 0.5 * reach.z * std::sin(2 * angle)};
    path.cameras.push_back({frame_name(i), intrinsics, look_at(eye + axes * offset, focus, up)});
  }
  return path;
}

CameraPath orbit_path(const Capture& capture, const PictureOptions& config) {
  const CameraArrangement cameras = arrangement_of(capture);
  const Cylinder cylinder = cylinder_about(cameras.focus, cameras.up);
  std::vector<double> angles, radii, heights;
  for (const View& view : capture.views) {
    angles.push_back(cylinder.angle(position_of(view)));
    radii.push_back(cylinder.radius(position_of(view)));
    heights.push_back(cylinder.height(position_of(view)));
  }
  const Arc arc = covered_arc(angles);
  CameraPath path{"orbit", {}};
  const Intrinsics intrinsics = path_intrinsics(capture, config);
  for (int i = 0; i < config.frames; ++i) {
    const Vec3d position =
        cylinder.point(angle_on(arc, i, config.frames), quantile(radii, 0.5), quantile(heights, 0.5));
    path.cameras.push_back({frame_name(i), intrinsics, look_at(position, cameras.focus, cameras.up)});
  }
  return path;
}

CameraPath turntable_path(const Capture& capture, const PictureOptions& config) {
  CameraPath path = arrangement_of(capture).forward_facing ? spiral_path(capture, config) : orbit_path(capture, config);
  path.name = "turntable";
  return path;
}

CameraPath held_out_path(const Capture& capture) {
  CameraPath path{"held-out", {}};
  PictureNames names;
  for (const View& view : capture.views) {
    if (!view.held_out) continue;
    path.cameras.push_back({names.name_for(view.name), view.intrinsics, view.world_from_camera});
  }
  if (path.cameras.empty()) {
    throw InputError(capture.root.string() + ": no view is held out; train with --holdout N to keep some");
  }
  return path;
}

CameraPath make_path(const std::string& kind, const Capture& capture, const PictureOptions& config) {
  if (kind == "spiral") return spiral_path(capture, config);
  if (kind == "orbit") return orbit_path(capture, config);
  if (kind == "turntable") return turntable_path(capture, config);
  if (kind == "held-out") return held_out_path(capture);
  return path_from_file(kind);
}

}  // namespace cnerf
