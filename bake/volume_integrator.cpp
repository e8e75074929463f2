#include "bake/volume_integrator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "bake/brick_grid.h"
#include "bake/dilate.h"
#include "src/base/aabb.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

struct Sample {
  float sigma = 0;  // 1/voxel
  Vec3f rgb{};
};

struct Radiance {
  Vec3d rgb{};
  double transmittance = 1;
};

/// The volume in voxel coordinates: voxel ijk covers [ijk, ijk + 1), its value sits at the centre.
class VoxelMedium {
 public:
  explicit VoxelMedium(const BakedVolume& volume) : grid_(fill(volume)), near_(bricks_with_neighbours(grid_)) {
    box_ = {grid_.min().cast<double>(), (grid_.min() + grid_.size()).cast<double>()};
  }
  [[nodiscard]] const Aabbd& box() const { return box_; }

  [[nodiscard]] Sample interpolated(Vec3d p) const {
    const Vec3d q = p - Vec3d{0.5, 0.5, 0.5};
    const Vec3i base = floored(q);
    const Vec3f t = (q - base.cast<double>()).cast<float>();
    Sample sum;
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3i step{corner >> 2, corner >> 1 & 1, corner & 1};
      const float weight = (step.x ? t.x : 1 - t.x) * (step.y ? t.y : 1 - t.y) * (step.z ? t.z : 1 - t.z);
      const Sample& value = grid_.at(base + step);
      sum.sigma += weight * value.sigma;
      sum.rgb += value.rgb * weight;
    }
    return sum;
  }

  /// Distance, from p along d, over which interpolation cannot find anything; 0 where it might.
  [[nodiscard]] double empty_distance(Vec3d p, Vec3d d) const {
    const Vec3i voxel = floored(p);
    if (!grid_.contains(voxel)) return 0;
    const std::size_t brick = grid_.brick_of(voxel);
    if (near_[brick]) return 0;
    const Vec3i low = grid_.brick_min(brick);
    double exit = std::numeric_limits<double>::max();
    for (int axis = 0; axis < 3; ++axis) {
      if (d[axis] == 0) continue;
      exit = std::min(exit, (low[axis] + (d[axis] > 0 ? kBrickSide : 0) - p[axis]) / d[axis]);
    }
    return std::max(0.0, exit);
  }

 private:
  static Vec3i floored(Vec3d p) {
    return {static_cast<int>(std::floor(p.x)), static_cast<int>(std::floor(p.y)), static_cast<int>(std::floor(p.z))};
  }
  static BrickGrid<Sample> fill(const BakedVolume& volume) {
    const VoxelBox box = bounding_box(volume.voxels);
    // One voxel of margin: interpolation reaches half a voxel beyond the outermost centres.
    BrickGrid<Sample> grid(box.min - Vec3i{1, 1, 1}, box.size + Vec3i{2, 2, 2}, Sample{});
    const auto h = static_cast<float>(volume.voxel_size);
    for (const BakedVoxel& voxel : volume.voxels) {
      grid.set({voxel.i, voxel.j, voxel.k}, {voxel.sigma * h, voxel.rgb});
    }
    return grid;
  }

  BrickGrid<Sample> grid_;
  std::vector<char> near_;
  Aabbd box_;
};

/// @param origin, direction  voxel coordinates; direction of unit length.
Radiance integrate_ray(const VoxelMedium& medium, Vec3d origin, Vec3d direction, double dt) {
  constexpr double kOpaque = 1e-7;
  Radiance result;
  const auto inside = intersect(medium.box(), origin, direction);
  if (!inside) return result;
  for (double begin = inside->begin; begin < inside->end && result.transmittance > kOpaque;) {
    const double length = std::min(dt, inside->end - begin);
    const Vec3d middle = origin + direction * (begin + length / 2);
    const double empty = medium.empty_distance(middle, direction);
    if (empty > 0) {
      begin += dt * std::max(1.0, std::floor(empty / dt));  // whole steps: skipping must not move the others
      continue;
    }
    const Sample sample = medium.interpolated(middle);
    const double alpha = -std::expm1(-sample.sigma * length);
    result.rgb += sample.rgb.cast<double>() * (result.transmittance * alpha);
    result.transmittance *= 1 - alpha;
    begin += length;
  }
  return result;
}

}  // namespace

VolumeImage integrate_volume(const BakedVolume& volume, const Intrinsics& intrinsics, const Affined& world_from_camera,
                             const IntegratorOptions& options) {
  CNERF_CHECK(!volume.voxels.empty() && volume.voxel_size > 0, "an empty volume cannot be rendered");
  CNERF_CHECK(options.step > 0 && options.samples_per_axis > 0, "integrator options must be positive");
  const VoxelMedium medium(volume);
  const int n = options.samples_per_axis;
  const Vec3d origin = (world_from_camera.translation - volume.origin) / volume.voxel_size;
  VolumeImage image;
  image.width = intrinsics.width;
  image.height = intrinsics.height;
  const std::size_t pixels = static_cast<std::size_t>(image.width) * image.height;
  image.rgb.resize(3 * pixels);
  image.opacity.resize(pixels);
  parallel_tasks(static_cast<std::size_t>(image.height), [&](std::size_t y) {
    for (int x = 0; x < image.width; ++x) {
      Vec3d rgb{};
      double opacity = 0;
      for (int s = 0; s < n * n; ++s) {
        const PixelPosition pixel{x + (s % n + 0.5) / n, static_cast<double>(y) + (s / n + 0.5) / n};
        const Vec3d direction = world_from_camera.direction(ray_direction(intrinsics, pixel));
        const Radiance ray = integrate_ray(medium, origin, normalized(direction), options.step);
        rgb += ray.rgb;
        opacity += 1 - ray.transmittance;
      }
      const std::size_t at = y * image.width + x;
      for (int c = 0; c < 3; ++c) image.rgb[3 * at + c] = static_cast<float>(rgb[c] / (n * n));
      image.opacity[at] = static_cast<float>(opacity / (n * n));
    }
  });
  return image;
}

}  // namespace cnerf
