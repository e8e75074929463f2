#include "bake/density/density_pass.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

/// Where the sub-samples of a voxel lie in it, 0..1, in order.
std::vector<Vec3d> places_in_voxel(int subsamples) {
  std::vector<Vec3d> places;
  for (int s = 0; s < subsamples * subsamples * subsamples; ++s) {
    const Vec3i sub{s / (subsamples * subsamples), s / subsamples % subsamples, s % subsamples};
    places.push_back((sub.cast<double>() + Vec3d{0.5, 0.5, 0.5}) / double(subsamples));
  }
  return places;
}

/// Sub-samples of a brick that may hold matter.
struct BrickSamples {
  std::vector<Vec3f> positions;       ///< unit space
  std::vector<std::uint32_t> places;  ///< of each: sub-sample of its voxel * kBrickVoxels + the voxel's offset
};

/// The sub-samples of a brick along one axis: coordinates of world and unit space go by axis.
struct AxisSamples {
  std::vector<float> unit;      ///< [kBrickSide * subsamples]
  std::vector<char> is_inside;  ///< of the plan's box
  std::vector<int> voxel;       ///< which of the brick's it is in
  std::vector<int> part;        ///< which of that voxel's it is
};

AxisSamples axis_samples(const SceneFrame& frame, const Plan& plan, int subsamples, Vec3i brick_min, int axis) {
  AxisSamples samples;
  for (int i = 0; i < kBrickSide * subsamples; ++i) {
    Vec3d voxel;
    const int whole = i / subsamples, part = i % subsamples;
    voxel[axis] = brick_min[axis] + whole + (part + 0.5) / subsamples;
    const Vec3d world = plan.world_from_voxel(voxel);
    samples.voxel.push_back(whole);
    samples.part.push_back(part);
    samples.is_inside.push_back(world[axis] >= plan.box.min[axis] && world[axis] <= plan.box.max[axis]);
    // Rounding may carry a point of the box's face just outside the field's domain.
    samples.unit.push_back(std::clamp(float(frame.unit_from_world(world)[axis]), 0.0f, 1.0f));
  }
  return samples;
}

BrickSamples gather_samples(const ColorField& field, const Plan& plan, int subsamples, Vec3i brick_min) {
  const SceneFrame& frame = field.frame();
  const AxisSamples x = axis_samples(frame, plan, subsamples, brick_min, 0);
  const AxisSamples y = axis_samples(frame, plan, subsamples, brick_min, 1);
  const AxisSamples z = axis_samples(frame, plan, subsamples, brick_min, 2);
  const std::size_t most = x.unit.size() * y.unit.size() * z.unit.size();
  std::vector<std::uint8_t> is_occupied(most);
  field.mark_occupied(x.unit, y.unit, z.unit, is_occupied);
  BrickSamples samples;
  const auto count = std::size_t(std::ranges::count(is_occupied, 1));
  if (count == 0) return samples;
  samples.positions.reserve(count);
  samples.places.reserve(count);
  for (std::size_t i = 0; i < x.unit.size(); ++i) {
    for (std::size_t j = 0; j < y.unit.size(); ++j) {
      if (!x.is_inside[i] || !y.is_inside[j]) continue;
      const std::uint8_t* occupied = &is_occupied[(i * y.unit.size() + j) * z.unit.size()];
      for (std::size_t k = 0; k < z.unit.size(); ++k) {
        if (occupied[k] == 0 || !z.is_inside[k]) continue;
        const Vec3i local{x.voxel[i], y.voxel[j], z.voxel[k]};
        if (plan.in_hole(brick_min + local)) continue;
        samples.positions.push_back({x.unit[i], y.unit[j], z.unit[k]});
        const int part = (x.part[i] * subsamples + y.part[j]) * subsamples + z.part[k];
        samples.places.push_back(std::uint32_t(part * kBrickVoxels + brick_offset(local)));
      }
    }
  }
  return samples;
}

void check_density(float sigma) {
  CNERF_CHECK(std::isfinite(sigma) && sigma >= 0,
              "the field answered a density of " + std::to_string(sigma) + "; expected a finite number >= 0");
}

/// Sums over the sub-samples of one voxel.
struct Accumulated {
  double alpha = 0;
  Vec3d alpha_inside{};
};

std::uint8_t in_256ths(double share) {
  return std::uint8_t(std::clamp(int(share * 256), 0, 255));
}

/// @param sigma  what the field answers, 1/unit length
std::vector<DenseVoxel> voxels_of(const BrickSamples& samples, std::span<const float> sigma, const SceneFrame& frame,
                                  double h, const Options& options, std::uint32_t brick) {
  const std::vector<Vec3d> places = places_in_voxel(options.subsamples);
  std::vector<Accumulated> sums(kBrickVoxels);
  for (std::size_t s = 0; s < sigma.size(); ++s) {
    check_density(sigma[s]);
    const double alpha = -std::expm1(-sigma[s] * frame.unit_per_world * h);
    Accumulated& sum = sums[samples.places[s] % kBrickVoxels];
    sum.alpha += alpha;
    sum.alpha_inside += places[samples.places[s] / kBrickVoxels] * alpha;
  }

  std::vector<DenseVoxel> kept;
  const double count = std::pow(options.subsamples, 3);  // skipped sub-samples count as clear
  for (int offset = 0; offset < kBrickVoxels; ++offset) {
    const Accumulated& sum = sums[offset];
    const double alpha = sum.alpha / count;
    if (sum.alpha <= 0 || alpha < options.opacity_threshold) continue;
    const double density = std::min(max_sigma(h), -std::log1p(-alpha) / h);
    const Vec3d inside = sum.alpha_inside / sum.alpha;
    kept.push_back({float(density),
                    brick,
                    std::uint16_t(offset),
                    {in_256ths(inside.x), in_256ths(inside.y), in_256ths(inside.z)}});
  }
  return kept;
}

/// Bricks of a plane, by one question to the field.
std::vector<std::vector<DenseVoxel>> bake_bricks(const ColorField& field, const Plan& plan, const Options& options,
                                                 int plane, std::span<const std::uint32_t> bricks) {
  std::vector<BrickSamples> samples(bricks.size());
  parallel_tasks(bricks.size(), [&](std::size_t b) {
    samples[b] = gather_samples(field, plan, options.subsamples, brick_min_of(plan, plane, bricks[b]));
  });
  std::vector<Vec3f> positions;
  std::vector<std::size_t> begins = {0};
  for (const BrickSamples& of_brick : samples) {
    positions.insert(positions.end(), of_brick.positions.begin(), of_brick.positions.end());
    begins.push_back(positions.size());
  }
  std::vector<float> sigma(positions.size());
  if (!positions.empty()) field.query_density(positions, sigma);
  std::vector<std::vector<DenseVoxel>> voxels(bricks.size());
  parallel_tasks(bricks.size(), [&](std::size_t b) {
    const auto answers = std::span<const float>(sigma).subspan(begins[b], begins[b + 1] - begins[b]);
    if (!answers.empty()) {
      voxels[b] = voxels_of(samples[b], answers, field.frame(), plan.voxel_size, options, bricks[b]);
    }
  });
  return voxels;
}

}  // namespace

double max_sigma(double voxel_size) {
  constexpr double kOpaqueDepth = 20;
  return kOpaqueDepth / voxel_size;
}

int plane_count(const Plan& plan) {
  return (plan.resolution.x + kBrickSide - 1) / kBrickSide;
}
Vec3i plane_bricks(const Plan& plan) {
  return {1, (plan.resolution.y + kBrickSide - 1) / kBrickSide, (plan.resolution.z + kBrickSide - 1) / kBrickSide};
}
Vec3i brick_min_of(const Plan& plan, int plane, std::uint32_t brick) {
  const auto row = std::uint32_t(plane_bricks(plan).z);
  return Vec3i{plane, int(brick / row), int(brick % row)} * kBrickSide;
}

std::vector<DenseVoxel> bake_density_bricks(const ColorField& field, const Plan& plan, const Options& options,
                                            int plane, std::span<const std::uint32_t> bricks) {
  const std::size_t samples_of_brick = kBrickVoxels * std::size_t(std::pow(options.subsamples, 3));
  const std::size_t at_a_time = std::max<std::size_t>(1, field.points_at_a_time() / samples_of_brick);
  std::vector<std::vector<DenseVoxel>> parts((bricks.size() + at_a_time - 1) / at_a_time);
  parallel_tasks(parts.size(), [&](std::size_t part) {
    const std::size_t begin = part * at_a_time, count = std::min(at_a_time, bricks.size() - begin);
    for (const auto& brick : bake_bricks(field, plan, options, plane, bricks.subspan(begin, count))) {
      parts[part].insert(parts[part].end(), brick.begin(), brick.end());
    }
  });
  std::vector<DenseVoxel> voxels;
  for (const std::vector<DenseVoxel>& part : parts) voxels.insert(voxels.end(), part.begin(), part.end());
  return voxels;
}

std::vector<DenseVoxel> bake_density_plane(const ColorField& field, const Plan& plan, const Options& options,
                                           int plane) {
  const Vec3i counts = plane_bricks(plan);
  std::vector<std::uint32_t> bricks(std::size_t(counts.y) * counts.z);
  std::iota(bricks.begin(), bricks.end(), 0u);
  return bake_density_bricks(field, plan, options, plane, bricks);
}

BrickGrid<float> empty_density(const Plan& plan) {
  return {{0, 0, 0}, plan.resolution, 0.0f};
}

void put_plane(std::span<const DenseVoxel> voxels, int plane, BrickGrid<float>& sigma) {
  const Vec3i counts = sigma.brick_counts();
  const std::size_t first = std::size_t(plane) * counts.y * counts.z;
  for (const DenseVoxel& voxel : voxels) sigma.make_brick(first + voxel.brick)[voxel.offset] = voxel.sigma;
}

bool is_plane_of(const Plan& plan, std::span<const DenseVoxel> voxels) {
  const Vec3i counts = plane_bricks(plan);
  const std::size_t bricks = std::size_t(counts.y) * counts.z;
  const auto is_sound = [&](const DenseVoxel& voxel) {
    return voxel.brick < bricks && voxel.offset < kBrickVoxels && std::isfinite(voxel.sigma) && voxel.sigma > 0;
  };
  const auto is_not_before = [](const DenseVoxel& a, const DenseVoxel& b) {
    return std::tie(a.brick, a.offset) >= std::tie(b.brick, b.offset);
  };
  return std::ranges::all_of(voxels, is_sound) && std::ranges::adjacent_find(voxels, is_not_before) == voxels.end();
}

BrickGrid<float> bake_density(const ColorField& field, const Plan& plan, const Options& options,
                              const std::function<void(double)>& advance) {
  BrickGrid<float> sigma = empty_density(plan);
  for (int plane = 0; plane < plane_count(plan); ++plane) {
    put_plane(bake_density_plane(field, plan, options, plane), plane, sigma);
    advance((plane + 1.0) / plane_count(plan));
  }
  return sigma;
}

}  // namespace cnerf::bake
