#include "bake/volume/integrate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "bake/lattice/brick_grid.h"
#include "bake/volume/dilate.h"
#include "src/base/aabb.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

struct Sample {
  float sigma = 0;  // 1/world unit
  Vec3f rgb{};
};

struct Radiance {
  Vec3d rgb{};
  double transmittance = 1;
};

/// A volume in voxel coordinates: voxel ijk covers [ijk, ijk + 1), its value sits at the centre.
class VoxelMedium {
 public:
  explicit VoxelMedium(const Volume& volume)
      : origin_(volume.origin),
        voxel_size_(volume.voxel_size),
        grid_(fill(volume)),
        near_(bricks_with_neighbours(grid_)) {
    box_ = {grid_.min().cast<double>(), (grid_.min() + grid_.size()).cast<double>()};
  }
  [[nodiscard]] double voxel_size() const { return voxel_size_; }
  [[nodiscard]] Vec3d voxel_from_world(Vec3d p) const { return (p - origin_) / voxel_size_; }
  /// Whether a ray from here is in the box or enters it within a distance.  @param distance  world units
  [[nodiscard]] bool is_near(Vec3d world, Vec3d direction, double distance) const {
    const auto ahead = intersect(box_, voxel_from_world(world), direction);
    return ahead && ahead->begin * voxel_size_ <= distance;
  }
  /// Stretch of a ray through the box, in world units along it.
  [[nodiscard]] std::optional<Interval<double>> stretch(Vec3d world, Vec3d direction) const {
    const auto inside = intersect(box_, voxel_from_world(world), direction);
    if (!inside) return std::nullopt;
    return Interval<double>{inside->begin * voxel_size_, inside->end * voxel_size_};
  }

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

  /// Distance in voxels, from p along d, over which interpolation cannot find anything; 0 where it might.
  [[nodiscard]] double empty_distance(Vec3d p, Vec3d d) const {
    const Vec3i voxel = floored(p);
    if (!grid_.contains(voxel)) {
      const auto ahead = intersect(box_, p, d);
      return ahead && ahead->end > 0 ? std::max(ahead->begin, 1e-3) : std::numeric_limits<double>::max();
    }
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
  static Vec3i floored(Vec3d p) { return {int(std::floor(p.x)), int(std::floor(p.y)), int(std::floor(p.z))}; }
  static BrickGrid<Sample> fill(const Volume& volume) {
    const VoxelBox box = bounding_box(volume.voxels);
    // One voxel of margin: interpolation reaches half a voxel beyond the outermost centres.
    BrickGrid<Sample> grid(box.low - Vec3i{1, 1, 1}, box.size() + Vec3i{2, 2, 2}, Sample{});
    for (const Voxel& voxel : volume.voxels) grid.set({voxel.i, voxel.j, voxel.k}, {voxel.sigma, voxel.rgb});
    return grid;
  }

  Vec3d origin_;
  double voxel_size_;
  BrickGrid<Sample> grid_;
  std::vector<char> near_;
  Aabbd box_;
};

/// What all media together hold at a point, and how far nothing is if they hold nothing.
struct Mixture {
  double sigma = 0;                                   ///< 1/world unit
  Vec3d emission{};                                   ///< density times colour
  double empty = std::numeric_limits<double>::max();  ///< world units
};

Mixture mixture_at(const std::vector<VoxelMedium>& media, Vec3d world, Vec3d direction) {
  Mixture mixture;
  for (const VoxelMedium& medium : media) {
    const Vec3d p = medium.voxel_from_world(world);
    const double empty = medium.empty_distance(p, direction);
    if (empty > 0) {
      mixture.empty = std::min(mixture.empty, empty * medium.voxel_size());
      continue;
    }
    mixture.empty = 0;
    const Sample sample = medium.interpolated(p);
    mixture.sigma += sample.sigma;
    mixture.emission += (sample.rgb * sample.sigma).cast<double>();
  }
  return mixture;
}

/// Of the finest voxels that are within one step of the coarsest.
/// @param media  finest first
double voxel_size_near(const std::vector<VoxelMedium>& media, Vec3d world, Vec3d direction, double voxel_share) {
  const double reach = voxel_share * media.back().voxel_size();
  for (const VoxelMedium& medium : media) {
    if (medium.is_near(world, direction, reach)) return medium.voxel_size();
  }
  return media.back().voxel_size();
}

/// @param media         finest first
/// @param voxel_share   step, voxels
Radiance integrate_ray(const std::vector<VoxelMedium>& media, Vec3d origin, Vec3d direction, double voxel_share) {
  constexpr double kOpaque = 1e-7;
  Radiance result;
  double begin = std::numeric_limits<double>::max(), end = 0;
  for (const VoxelMedium& medium : media) {
    if (const auto stretch = medium.stretch(origin, direction)) {
      begin = std::min(begin, stretch->begin);
      end = std::max(end, stretch->end);
    }
  }
  while (begin < end && result.transmittance > kOpaque) {
    const double step = voxel_share * voxel_size_near(media, origin + direction * begin, direction, voxel_share);
    const double length = std::min(step, end - begin);
    const Mixture mixture = mixture_at(media, origin + direction * (begin + length / 2), direction);
    if (mixture.empty > 0) {
      begin += step * std::max(1.0, std::floor(mixture.empty / step));  // whole steps: skipping moves no other
      continue;
    }
    if (mixture.sigma > 0) {
      const double alpha = -std::expm1(-mixture.sigma * length);
      result.rgb += mixture.emission * (result.transmittance * alpha / mixture.sigma);
      result.transmittance *= 1 - alpha;
    }
    if (begin + length == begin) break;  // the camera is too far away for steps of this size
    begin += length;
  }
  return result;
}

/// Finest first.
std::vector<VoxelMedium> media_of(std::span<const Volume> volumes) {
  CNERF_CHECK(!volumes.empty(), "there is no volume to render");
  std::vector<VoxelMedium> media;
  for (const Volume& volume : volumes) {
    CNERF_CHECK(!volume.voxels.empty() && volume.voxel_size > 0, "an empty volume cannot be rendered");
    media.emplace_back(volume);
  }
  std::ranges::sort(media, {}, &VoxelMedium::voxel_size);
  return media;
}

}  // namespace

VolumeImage integrate_volumes(std::span<const Volume> volumes, const Intrinsics& intrinsics,
                              const Affined& world_from_camera, const IntegratorOptions& options) {
  CNERF_CHECK(options.step > 0 && options.samples_per_axis > 0, "integrator options must be positive");
  const std::vector<VoxelMedium> media = media_of(volumes);
  const int n = options.samples_per_axis;
  VolumeImage image;
  image.width = intrinsics.width;
  image.height = intrinsics.height;
  const std::size_t pixels = std::size_t(image.width) * image.height;
  image.rgb.resize(3 * pixels);
  image.opacity.resize(pixels);
  parallel_tasks(std::size_t(image.height), [&](std::size_t y) {
    for (int x = 0; x < image.width; ++x) {
      Vec3d rgb{};
      double opacity = 0;
      for (int s = 0; s < n * n; ++s) {
        const int column = s % n, row = s / n;
        const PixelPosition pixel{x + (column + 0.5) / n, double(y) + (row + 0.5) / n};
        const Vec3d direction = normalized(world_from_camera.direction(ray_direction(intrinsics, pixel)));
        const Radiance ray = integrate_ray(media, world_from_camera.translation, direction, options.step);
        rgb += ray.rgb;
        opacity += 1 - ray.transmittance;
      }
      const std::size_t at = y * image.width + x;
      for (int c = 0; c < 3; ++c) image.rgb[3 * at + c] = float(rgb[c] / (n * n));
      image.opacity[at] = float(opacity / (n * n));
    }
  });
  return image;
}

struct VolumeLookup::Media {
  std::vector<VoxelMedium> all;
};

VolumeLookup::VolumeLookup(std::span<const Volume> volumes)
    : media_(std::make_unique<const Media>(Media{media_of(volumes)})) {}

VolumeLookup::~VolumeLookup() = default;

void VolumeLookup::query(std::span<const Vec3d> positions, std::span<float> sigma, std::span<Vec3f> rgb) const {
  constexpr std::size_t kGrain = 4096;
  constexpr double kFar = 1e9;  // voxels; numbers of voxels are of 32 bits
  const std::vector<VoxelMedium>& media = media_->all;
  parallel_ranges(positions.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3d p = media.front().voxel_from_world(positions[i]);
      const bool is_near = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) < kFar;
      const Mixture mixture = is_near ? mixture_at(media, positions[i], {1, 0, 0}) : Mixture{};
      sigma[i] = float(mixture.sigma);
      rgb[i] = mixture.sigma > 0 ? (mixture.emission / mixture.sigma).cast<float>() : Vec3f{};
    }
  });
}

}  // namespace cnerf::bake
