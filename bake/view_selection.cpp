#include "bake/view_selection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace cnerf {
namespace {

constexpr float kGoodTransmittance = 0.5f;  ///< a view with less is replaced when a better one is found
constexpr int kTriesPerView = 3;            ///< cameras tried for each view wanted, once there are enough dim ones
constexpr std::size_t kSpreadViews = 32;    ///< views picked by spread; the rest follows by distance

/// Steps until the ray leaves the brick that starts at `low`, at least one. Rays stay on the lattice of whole steps, so
/// that skipping changes nothing.
int steps_across_brick(Vec3i low, Vec3f p, Vec3f inverse_direction) {
  float exit = std::numeric_limits<float>::max();
  for (int axis = 0; axis < 3; ++axis) {
    const float face = static_cast<float>(low[axis] + (inverse_direction[axis] > 0 ? kBrickSide : 0));
    const float distance = (face - p[axis]) * inverse_direction[axis];
    if (distance >= 0) exit = std::min(exit, distance);  // not for NaN: parallel to the face and on it
  }
  return std::max(1, static_cast<int>(std::min(exit, 1e6f)));
}

/// Where a ray from `p` comes into [0, size); 0 when it starts there, infinity when it misses.
float entry(Vec3f p, Vec3f inverse_direction, Vec3f size) {
  float enter = 0, leave = std::numeric_limits<float>::max();
  for (int axis = 0; axis < 3; ++axis) {
    const float a = -p[axis] * inverse_direction[axis], b = (size[axis] - p[axis]) * inverse_direction[axis];
    if (std::isnan(a) || std::isnan(b)) continue;  // parallel to a face and on it
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter <= leave ? enter : std::numeric_limits<float>::infinity();
}

bool inside(Vec3f p, Vec3f size) {
  return p.x >= 0 && p.y >= 0 && p.z >= 0 && p.x < size.x && p.y < size.y && p.z < size.z;
}

}  // namespace

float transmittance_between(const BrickGrid<float>& sigma, double voxel_size, Vec3f from, Vec3f to, float stop_below) {
  const Vec3f path = to - from;
  const float distance = length(path);
  if (!(distance > 1.0f)) return 1.0f;
  const Vec3f d = path / distance;
  const Vec3f inverse{1 / d.x, 1 / d.y, 1 / d.z};
  const Vec3f start = from - sigma.min().cast<float>();
  const Vec3f size = sigma.size().cast<float>();
  const auto h = static_cast<float>(voxel_size);
  const float deepest = -std::log(stop_below);
  float depth = 0;
  // Whole steps from the start, so that where a ray comes in does not matter; the first may round to just outside.
  const float enter = std::max(1.0f, std::ceil(entry(start, inverse, size)));
  for (float t = enter; t < distance;) {
    const Vec3f p = start + d * t;
    if (!inside(p, size)) break;  // the box is convex: what left it does not come back
    const Vec3i voxel = p.cast<int>();
    const float* brick = sigma.find_brick(voxel);
    if (brick == nullptr) {
      const Vec3i low{voxel.x & ~(kBrickSide - 1), voxel.y & ~(kBrickSide - 1), voxel.z & ~(kBrickSide - 1)};
      t += static_cast<float>(steps_across_brick(low, p, inverse));
      continue;
    }
    depth += brick[sigma.offset_in_brick(voxel)] * h;
    if (depth > deepest) return 0;
    t += 1;
  }
  return std::exp(-depth);
}

ViewSelection::ViewSelection(const std::vector<BakeCamera>& cameras, const BakePlan& plan, const BakeOptions& options)
    : plan_(plan),
      views_per_voxel_(options.views_per_voxel),
      seen_transmittance_(static_cast<float>(std::max(options.seen_transmittance, 1e-8))) {
  for (const BakeCamera& camera : cameras) {
    eyes_.push_back({camera.intrinsics, camera.world_from_camera.inverse(), camera.world_from_camera.translation});
  }
}

Vec3f ViewSelection::direction_to(int camera, Vec3d world) const {
  return normalized(world - eyes_[camera].centre).cast<float>();
}

std::vector<int> ViewSelection::try_order(Vec3d world) const {
  const std::size_t n = eyes_.size();
  std::vector<Vec3d> directions(n);
  std::vector<double> footprint(n);  // size of a pixel there, world units
  for (std::size_t i = 0; i < n; ++i) {
    const double distance = std::max(length(world - eyes_[i].centre), 1e-12);
    directions[i] = (world - eyes_[i].centre) / distance;
    footprint[i] = distance / eyes_[i].intrinsics.fx;
  }
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return footprint[a] < footprint[b]; });

  std::vector<double> closest(n, -1);  // largest cosine to a camera picked so far
  for (std::size_t picked = 1; picked < std::min(n, kSpreadViews); ++picked) {
    for (std::size_t i = picked; i < n; ++i) {
      closest[order[i]] = std::max(closest[order[i]], dot(directions[order[i]], directions[order[picked - 1]]));
    }
    const auto farthest = std::min_element(order.begin() + static_cast<std::ptrdiff_t>(picked), order.end(),
                                           [&](int a, int b) { return closest[a] < closest[b]; });
    std::rotate(order.begin() + static_cast<std::ptrdiff_t>(picked), farthest, farthest + 1);
  }
  return order;
}

bool ViewSelection::has_in_picture(const Eye& eye, Vec3d world) const {
  const auto pixel = project(eye.intrinsics, eye.camera_from_world.point(world));
  return pixel && pixel->x >= 0 && pixel->y >= 0 && pixel->x <= eye.intrinsics.width &&
         pixel->y <= eye.intrinsics.height;
}

float ViewSelection::transmittance_to(const Eye& eye, const BrickGrid<float>& sigma, Vec3d world, float least) const {
  const auto through = [&](const BrickGrid<float>& grid, const BakePlan& plan) {
    return transmittance_between(grid, plan.voxel_size, plan.voxel_from_world(world).cast<float>(),
                                 plan.voxel_from_world(eye.centre).cast<float>(), least);
  };
  float transmittance = through(sigma, plan_);
  for (const Level& other : others_) {
    if (transmittance < least) break;
    transmittance *= through(*other.sigma, *other.plan);
  }
  return transmittance;
}

std::vector<SeenBy> ViewSelection::seen_by(const BrickGrid<float>& sigma, Vec3d world, const std::vector<int>& order,
                                           float least) const {
  least = std::max(least, seen_transmittance_);
  std::vector<SeenBy> seen;
  int good = 0, tried = 0;
  const int enough_tries = kTriesPerView * views_per_voxel_;
  for (const int camera : order) {
    const Eye& eye = eyes_[camera];
    if (!has_in_picture(eye, world)) continue;
    // Matter just below a surface is seen dimly by many: the cameras tried so far surround it already.
    if (++tried > enough_tries && static_cast<int>(seen.size()) >= views_per_voxel_) break;
    const float transmittance = transmittance_to(eye, sigma, world, least);
    if (transmittance < least) continue;
    seen.push_back({camera, transmittance});
    good += transmittance >= kGoodTransmittance ? 1 : 0;
    if (good == views_per_voxel_) break;
  }
  std::stable_sort(seen.begin(), seen.end(),
                   [](const SeenBy& a, const SeenBy& b) { return a.transmittance > b.transmittance; });
  if (seen.size() > static_cast<std::size_t>(views_per_voxel_)) seen.resize(views_per_voxel_);
  return seen;
}

}  // namespace cnerf
