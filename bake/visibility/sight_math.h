#pragma once
/// Which cameras see a point through baked density: the arithmetic that processor and kernels share. `Grid` is what
/// find_brick, clear_bricks, min and size of BrickGrid<float> say.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "bake/lattice/brick_grid.h"
#include "src/base/host_device.h"
#include "src/base/vec3.h"
#include "src/capture/camera_math.h"

namespace cnerf::bake {

/// How far a camera sees, in cells of its picture.
struct DepthMap {
  const float* values = nullptr;  ///< [height][width] distances, world units; none: as far as there is light
  int width = 0, height = 0;
  float cells_per_pixel = 0;

  [[nodiscard]] CNERF_HD bool hides(PixelPosition pixel, double distance) const {
    if (values == nullptr) return false;
    const int x = std::min(int(float(pixel.x) * cells_per_pixel), width - 1);
    const int y = std::min(int(float(pixel.y) * cells_per_pixel), height - 1);
    return distance > double(values[std::size_t(y) * std::size_t(width) + std::size_t(x)]);
  }
};

/// A camera of a bake.
struct Eye {
  Intrinsics intrinsics;
  Affined camera_from_world;
  Vec3d centre{};  ///< world
  DepthMap depths;
};

/// A point, and what makes a camera see it.
struct Sight {
  Vec3d world{};            ///< world units
  float least = 0;          ///< transmittance below which a camera does not count, if above kSeenTransmittance
  std::uint32_t order = 0;  ///< which order of cameras is tried
};

/// A camera and how much of a point's light reaches it.
struct SeenBy {
  std::int32_t camera = 0;
  float transmittance = 0;
};

/// Density that light passes, on its lattice: voxel ijk covers [ijk, ijk + 1) * voxel_size + origin, world units.
template <typename Grid>
struct SightLevel {
  const Grid* sigma = nullptr;
  Vec3d origin{};
  double voxel_size = 0;

  [[nodiscard]] CNERF_HD Vec3f voxel_from_world(Vec3d p) const {
    return ((p - origin) / voxel_size).template cast<float>();
  }
};

/// All that a point's visibility depends on.
template <typename Grid>
struct SightScene {
  const Eye* eyes = nullptr;
  int eye_count = 0;
  const SightLevel<Grid>* levels = nullptr;
  int level_count = 0;
  int views = 0;  ///< cameras wanted for a point
};

namespace sight {

inline constexpr float kSeenTransmittance = 1e-3f;  ///< below which a camera does not see a point
inline constexpr float kGoodTransmittance = 0.5f;   ///< a view with less is replaced when a better one is found
inline constexpr int kTriesPerView = 3;  ///< cameras tried for each view wanted, once there are enough dim ones

/// Steps until the ray leaves the cube that starts at `low`, at least one. Rays stay on the lattice of whole steps, so
/// that skipping changes nothing.
CNERF_HD inline int steps_across(Vec3i low, int side, Vec3f p, Vec3f inverse_direction) {
  float exit = std::numeric_limits<float>::max();
  for (int axis = 0; axis < 3; ++axis) {
    const float face = float(low[axis] + (inverse_direction[axis] > 0 ? side : 0));
    const float distance = (face - p[axis]) * inverse_direction[axis];
    if (distance >= 0) exit = std::min(exit, distance);  // not for NaN: parallel to the face and on it
  }
  return std::max(1, int(std::min(exit, 1e6f)));
}

/// Where a ray from `p` comes into [0, size); 0 when it starts there, infinity when it misses.
CNERF_HD inline float entry(Vec3f p, Vec3f inverse_direction, Vec3f size) {
  float enter = 0, leave = std::numeric_limits<float>::max();
  for (int axis = 0; axis < 3; ++axis) {
    const float a = -p[axis] * inverse_direction[axis], b = (size[axis] - p[axis]) * inverse_direction[axis];
    if (std::isnan(a) || std::isnan(b)) continue;  // parallel to a face and on it
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter <= leave ? enter : std::numeric_limits<float>::infinity();
}

CNERF_HD inline bool inside(Vec3f p, Vec3f size) {
  return p.x >= 0 && p.y >= 0 && p.z >= 0 && p.x < size.x && p.y < size.y && p.z < size.z;
}

}  // namespace sight

/// What a ray comes through: by steps of one voxel with nearest-neighbour densities, from the first one on.
struct Passed {
  float depth = 0;  ///< optical
  float steps = 0;  ///< where `depth` came to exceed what was allowed; else infinite
};

/// @param from, to  voxel coordinates.  @param voxel_size  world units
template <typename Grid>
[[nodiscard]] CNERF_HD Passed pass_through(const Grid& sigma, double voxel_size, Vec3f from, Vec3f to, float deepest) {
  constexpr float kNever = std::numeric_limits<float>::infinity();
  const Vec3f path = to - from;
  const float distance = length(path);
  if (!(distance > 1.0f)) return {0, kNever};
  const Vec3f d = path / distance;
  const Vec3f inverse{1 / d.x, 1 / d.y, 1 / d.z};
  const Vec3f start = from - sigma.min().template cast<float>();
  const Vec3f size = sigma.size().template cast<float>();
  const auto h = float(voxel_size);
  float depth = 0;
  // Whole steps from the start, so that where a ray comes in does not matter; the first may round to just outside.
  const float enter = std::max(1.0f, std::ceil(sight::entry(start, inverse, size)));
  const float* brick = nullptr;
  Vec3i low{-1, -1, -1};  // of `brick`
  for (float t = enter; t < distance;) {
    const Vec3f p = start + d * t;
    const Vec3i voxel = p.template cast<int>();
    // Most steps stay in their brick, which lies in the box: what sticks out of that is empty.
    if (((voxel.x ^ low.x) | (voxel.y ^ low.y) | (voxel.z ^ low.z)) & ~(kBrickSide - 1)) {
      if (!sight::inside(p, size)) break;  // the box is convex: what left it does not come back
      brick = sigma.find_brick(voxel);
      low = {voxel.x & ~(kBrickSide - 1), voxel.y & ~(kBrickSide - 1), voxel.z & ~(kBrickSide - 1)};
    }
    if (brick == nullptr) {
      const int clear = kBrickSide * sigma.clear_bricks(voxel);
      t +=
          float(sight::steps_across({low.x - clear, low.y - clear, low.z - clear}, kBrickSide + 2 * clear, p, inverse));
      continue;
    }
    depth += brick[brick_offset(local_part(voxel))] * h;
    if (depth > deepest) return {depth, t};
    t += 1;
  }
  return {depth, kNever};
}

/// Transmittance between two points in voxel coordinates. The first voxel's length after `from` is left out: a surface
/// must not hide itself.
/// @param voxel_size  world units.  @return in [0, 1]; 0 once it falls below `stop_below`.
template <typename Grid>
[[nodiscard]] CNERF_HD float transmittance_between(const Grid& sigma, double voxel_size, Vec3f from, Vec3f to,
                                                   float stop_below) {
  const float deepest = -std::log(stop_below);
  const float depth = pass_through(sigma, voxel_size, from, to, deepest).depth;
  return depth > deepest ? 0 : std::exp(-depth);
}

/// How far along a ray there may be light: what lies farther from `from` than this and than its own voxel's size is not
/// seen from there.
/// @param from  voxel coordinates.  @param direction  of length 1.  @param most  what matters, world units
/// @return world units; infinite where nothing ends it before `most`
template <typename Grid>
[[nodiscard]] CNERF_HD float sight_end(const Grid& sigma, double voxel_size, Vec3f from, Vec3f direction, float most) {
  const Vec3f size = sigma.size().template cast<float>();
  const Vec3f middle = sigma.min().template cast<float>() + size * 0.5f;
  const float far = std::min(length(middle - from) + length(size), most / float(voxel_size));
  const float deepest = -std::log(sight::kSeenTransmittance);
  // Steps of other rays fall elsewhere within the voxel.
  return (pass_through(sigma, voxel_size, from, from + direction * far, deepest).steps + 1) * float(voxel_size);
}

/// From a point of level `own` to a camera, through all levels; anything below `least` once it falls below that.
template <typename Grid>
[[nodiscard]] CNERF_HD float transmittance_to(const SightScene<Grid>& scene, int own, const Eye& eye, Vec3d world,
                                              float least) {
  float transmittance = 1;
  for (int turn = 0; turn < scene.level_count; ++turn) {
    const int other = turn == 0     ? own
                      : turn <= own ? turn - 1
                                    : turn;  // its own first: it is the most likely to hide it
    const SightLevel<Grid>& level = scene.levels[other];
    transmittance *= transmittance_between(*level.sigma, level.voxel_size, level.voxel_from_world(world),
                                           level.voxel_from_world(eye.centre), least);
    if (transmittance < least) break;
  }
  return transmittance;
}

/// Where a camera has a point in its picture.
[[nodiscard]] CNERF_HD inline std::optional<PixelPosition> pixel_of(const Eye& eye, Vec3d world) {
  const auto pixel = lens::project(eye.intrinsics, eye.camera_from_world.point(world));
  const bool is_inside =
      pixel && pixel->x >= 0 && pixel->y >= 0 && pixel->x <= eye.intrinsics.width && pixel->y <= eye.intrinsics.height;
  return is_inside ? pixel : std::nullopt;
}

/// At most `scene.views` cameras that have the point in their picture and see it, best first.
/// @param order  [scene.eye_count] cameras as they are worth trying; what follows a -1 is not
/// @param seen   [scene.views] the answer.  @return how many there are.
template <typename Grid>
CNERF_HD int find_seeing(const SightScene<Grid>& scene, int own, const Sight& point, const std::int32_t* order,
                         SeenBy* seen) {
  const float least = point.least < sight::kSeenTransmittance ? sight::kSeenTransmittance : point.least;
  const double voxel_size = scene.levels[own].voxel_size;
  int count = 0, good = 0, tried = 0;
  for (int turn = 0; turn < scene.eye_count; ++turn) {
    if (order[turn] < 0) break;
    const Eye& eye = scene.eyes[order[turn]];
    const std::optional<PixelPosition> pixel = pixel_of(eye, point.world);
    if (!pixel) continue;
    // The cameras tried so far surround the point already. Just below a surface matter is seen dimly by many, deeper
    // inside by none.
    ++tried;
    if (count == scene.views && tried > sight::kTriesPerView * scene.views) break;
    if (eye.depths.hides(*pixel, length(point.world - eye.centre) - voxel_size)) continue;
    const float transmittance = transmittance_to(scene, own, eye, point.world, least);
    if (transmittance < least) continue;
    int place = count;  // behind all that are as good
    while (place > 0 && seen[place - 1].transmittance < transmittance) --place;
    if (place < scene.views) {
      count = std::min(count + 1, scene.views);
      for (int i = count - 1; i > place; --i) seen[i] = seen[i - 1];
      seen[place] = {order[turn], transmittance};
    }
    good += transmittance >= sight::kGoodTransmittance ? 1 : 0;
    if (good == scene.views) break;
  }
  return count;
}

}  // namespace cnerf::bake
