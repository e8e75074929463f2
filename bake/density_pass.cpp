#include "bake/density_pass.h"

#include <algorithm>
#include <cmath>

#include "src/base/parallel.h"

namespace cnerf {
namespace {

/// Rounding may carry a point of the box's face just outside the field's domain.
Vec3f clamped_to_unit(Vec3f p) {
  for (int axis = 0; axis < 3; ++axis) p[axis] = std::clamp(p[axis], 0.0f, 1.0f);
  return p;
}

/// Sub-samples of a brick that may hold matter, and the voxel each belongs to.
struct BrickSamples {
  std::vector<Vec3f> positions;  ///< unit space
  std::vector<Vec3f> insides;    ///< 0..1 in the voxel
  std::vector<std::int16_t> offsets;
};

BrickSamples gather_samples(const ColorField& field, const BakePlan& plan, int subsamples, Vec3i brick_min) {
  BrickSamples samples;
  for (int offset = 0; offset < kBrickVoxels; ++offset) {
    const Vec3i voxel = brick_min + brick_local(offset);
    if (plan.in_hole(voxel)) continue;
    for (int s = 0; s < subsamples * subsamples * subsamples; ++s) {
      const Vec3i sub{s / (subsamples * subsamples), s / subsamples % subsamples, s % subsamples};
      const Vec3d inside = (sub.cast<double>() + Vec3d{0.5, 0.5, 0.5}) / static_cast<double>(subsamples);
      const Vec3d world = plan.world_from_voxel(voxel.cast<double>() + inside);
      if (!plan.box.contains(world)) continue;
      const Vec3f unit = clamped_to_unit(field.frame().unit_from_world(world).cast<float>());
      if (!field.may_be_occupied(unit)) continue;
      samples.positions.push_back(unit);
      samples.insides.push_back(inside.cast<float>());
      samples.offsets.push_back(static_cast<std::int16_t>(offset));
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
  return static_cast<std::uint8_t>(std::clamp(static_cast<int>(share * 256), 0, 255));
}

/// The kept voxels of a brick; their densities go to `values`, which is made when there are any.
std::vector<DenseVoxel> bake_brick(const ColorField& field, const BakePlan& plan, const BakeOptions& options,
                                   Vec3i brick_min, const std::function<float*()>& values) {
  const BrickSamples samples = gather_samples(field, plan, options.subsamples, brick_min);
  if (samples.positions.empty()) return {};
  std::vector<float> sigma(samples.positions.size());
  field.query_density(samples.positions, sigma);

  const double h = plan.voxel_size;
  const double world_from_unit_density = field.frame().unit_per_world;  // 1/unit length -> 1/world unit
  std::vector<Accumulated> sums(kBrickVoxels);
  for (std::size_t s = 0; s < sigma.size(); ++s) {
    check_density(sigma[s]);
    const double alpha = -std::expm1(-sigma[s] * world_from_unit_density * h);
    Accumulated& sum = sums[samples.offsets[s]];
    sum.alpha += alpha;
    sum.alpha_inside += samples.insides[s].cast<double>() * alpha;
  }

  std::vector<DenseVoxel> kept;
  float* densities = nullptr;
  const double count = std::pow(options.subsamples, 3);  // skipped sub-samples count as clear
  for (int offset = 0; offset < kBrickVoxels; ++offset) {
    const Accumulated& sum = sums[offset];
    const double alpha = sum.alpha / count;
    if (sum.alpha <= 0 || alpha < options.opacity_threshold) continue;
    const double density = std::min(max_sigma(h), -std::log1p(-alpha) / h);
    const Vec3d inside = sum.alpha_inside / sum.alpha;
    if (densities == nullptr) densities = values();
    densities[offset] = static_cast<float>(density);
    kept.push_back(
        {static_cast<std::uint16_t>(offset), {in_256ths(inside.x), in_256ths(inside.y), in_256ths(inside.z)}});
  }
  kept.shrink_to_fit();
  return kept;
}

}  // namespace

double max_sigma(double voxel_size) {
  constexpr double kOpaqueDepth = 20;
  return kOpaqueDepth / voxel_size;
}

void parallel_batches(std::size_t tasks, const std::function<void(std::size_t)>& task,
                      const std::function<void(double)>& advance) {
  constexpr std::size_t kBatches = 64;
  for (std::size_t batch = 0; batch < kBatches; ++batch) {
    const std::size_t begin = tasks * batch / kBatches;
    const std::size_t end = tasks * (batch + 1) / kBatches;
    parallel_tasks(end - begin, [&](std::size_t i) { task(begin + i); });
    advance(static_cast<double>(batch + 1) / kBatches);
  }
}

DensityPass bake_density(const ColorField& field, const BakePlan& plan, const BakeOptions& options,
                         const std::function<void(double)>& advance) {
  DensityPass pass{BrickGrid<float>({0, 0, 0}, plan.resolution, 0.0f), {}};
  pass.bricks.resize(pass.sigma.brick_count());
  const auto bake_one = [&](std::size_t brick) {
    pass.bricks[brick] = bake_brick(field, plan, options, pass.sigma.brick_min(brick),
                                    [&] { return pass.sigma.make_brick(brick).data(); });
  };
  parallel_batches(pass.bricks.size(), bake_one, advance);
  return pass;
}

}  // namespace cnerf
