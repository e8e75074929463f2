#include "bake/splat/targets.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "src/base/check.h"
#include "src/base/rng.h"
#include "src/color/colorspace_math.h"

namespace cnerf::bake {
namespace {

constexpr std::size_t kMostCameras = 150;  ///< of the capture; as many lie between them

std::uint8_t in_255ths(float value) {
  return std::uint8_t(std::lround(255 * std::clamp(value, 0.0f, 1.0f)));
}

Vec3d axis_of(const Camera& camera) {
  return camera.world_from_camera.linear.column(2);
}

/// The nearest other camera whose axis is less than 60 degrees off; none where all are.
std::size_t neighbour_of(const std::vector<Camera>& cameras, std::size_t i) {
  std::size_t nearest = i;
  double least = 0;
  for (std::size_t j = 0; j < cameras.size(); ++j) {
    if (j == i || dot(axis_of(cameras[i]), axis_of(cameras[j])) < 0.5) continue;
    const double distance = length(cameras[j].world_from_camera.translation - cameras[i].world_from_camera.translation);
    if (distance > 0 && (nearest == i || distance < least)) {
      nearest = j;
      least = distance;
    }
  }
  return nearest;
}

/// Rows made orthogonal, of length 1.
Mat3d orthonormal(const Mat3d& m) {
  const Vec3d z = normalized(m.column(2));
  const Vec3d x = normalized(m.column(0) - z * dot(z, m.column(0)));
  return Mat3d::from_columns(x, cross(z, x), z);
}

Camera between(const Camera& a, const Camera& b) {
  Camera camera = a;
  camera.name = a.name + " / " + b.name;
  camera.world_from_camera.translation = (a.world_from_camera.translation + b.world_from_camera.translation) * 0.5;
  Mat3d mean;
  for (int i = 0; i < 3; ++i) mean.rows[i] = a.world_from_camera.linear.rows[i] + b.world_from_camera.linear.rows[i];
  const Vec3d across = cross(mean.column(2), mean.column(0));
  if (length(across) > 0.1) camera.world_from_camera.linear = orthonormal(mean);  // else one stands on its head
  return camera;
}

}  // namespace

Vec3d SplatTarget::point(int x, int y, double depth_there) const {
  const Vec3d in_camera = {(x + 0.5 - intrinsics.cx) / intrinsics.fx, (y + 0.5 - intrinsics.cy) / intrinsics.fy, 1};
  return world_from_camera.point(in_camera * depth_there);
}

Intrinsics reduced_pinhole(const Intrinsics& intrinsics, int side) {
  Intrinsics pinhole = intrinsics;
  pinhole.model = LensModel::kPinhole;
  pinhole.distortion = {};
  const int longest = std::max(pinhole.width, pinhole.height);
  if (longest <= side) return pinhole;
  const double share = double(side) / longest;
  return resized(pinhole, std::max(1, int(std::lround(share * pinhole.width))),
                 std::max(1, int(std::lround(share * pinhole.height))));
}

std::vector<Camera> target_cameras(const std::vector<Camera>& cameras) {
  std::vector<Camera> targets;
  const std::size_t kept = std::min(cameras.size(), kMostCameras);
  for (std::size_t i = 0; i < kept; ++i) targets.push_back(cameras[i * cameras.size() / kept]);
  std::set<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < kept; ++i) {
    const std::size_t j = neighbour_of(targets, i);
    if (j != i) pairs.emplace(std::min(i, j), std::max(i, j));
  }
  for (const auto& [i, j] : pairs) targets.push_back(between(targets[i], targets[j]));
  return targets;
}

std::vector<SplatTarget> draw_targets(const std::vector<Camera>& cameras, const DrawField& draw, int side,
                                      const std::function<void(double)>& advance) {
  const CounterRng rng(0, named_stream("targets"));
  std::vector<SplatTarget> targets;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    SplatTarget target;
    target.intrinsics = reduced_pinhole(cameras[i].intrinsics, side);
    target.world_from_camera = cameras[i].world_from_camera;
    const double reduction = double(cameras[i].intrinsics.width) / target.intrinsics.width;
    target.blur = kViewerBlur / (reduction * reduction);
    const double leeway = 1 - 1 / reduction;  // of a pixel, in which pixels of the whole picture lie
    target.intrinsics.cx += leeway * (rng.uniform(2 * i) - 0.5);
    target.intrinsics.cy += leeway * (rng.uniform(2 * i + 1) - 0.5);
    FieldPicture picture = draw(target.intrinsics, target.world_from_camera);
    const std::size_t pixels = std::size_t(target.intrinsics.width) * std::size_t(target.intrinsics.height);
    CNERF_CHECK(picture.rgb.size() == 3 * pixels && picture.opacity.size() == pixels && picture.depth.size() == pixels,
                "a picture of the field has the wrong size");
    target.rgba.resize(4 * pixels);
    for (std::size_t p = 0; p < pixels; ++p) {
      for (std::size_t c = 0; c < 3; ++c) {
        target.rgba[4 * p + c] = in_255ths(srgb_from_linear(picture.rgb[3 * p + c]));
      }
      target.rgba[4 * p + 3] = in_255ths(picture.opacity[p]);
    }
    target.depth = std::move(picture.depth);
    targets.push_back(std::move(target));
    advance(double(i + 1) / double(cameras.size()));
  }
  return targets;
}

}  // namespace cnerf::bake
