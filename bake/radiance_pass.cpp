#include "bake/radiance_pass.h"

#include <algorithm>
#include <cmath>

#include "bake/dilate.h"
#include "bake/sharpen.h"
#include "bake/view_average.h"
#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

bool in_gamut(Vec3f rgb, float luminance) {
  const float top = std::max(1.0f, luminance);
  for (int channel = 0; channel < 3; ++channel) {
    if (rgb[channel] < 0 || rgb[channel] > top) return false;
  }
  return true;
}

}  // namespace

VoxelColor voxel_color(float luminance, Chromaticity chromaticity) {
  if (chromaticity.x == 1 && chromaticity.z == 1) return {{luminance, luminance, luminance}, 0, 0};
  const Vec3f xyz{luminance * chromaticity.x, luminance, luminance * chromaticity.z};
  VoxelColor color;
  color.rgb = linear_rgb_from_relative_xyz(xyz);
  if (!in_gamut(color.rgb, luminance)) {
    color.rgb = gamut_mapped_linear_rgb_from_lab(lab_from_linear_rgb(color.rgb));
  }
  const Lab<float> lab = lab_from_linear_rgb(color.rgb);
  color.a = lab.a;
  color.b = lab.b;
  return color;
}

/// What is asked of the field for one brick.
struct RadiancePass::Queries {
  std::vector<std::size_t> voxels;  ///< index into the brick's dense voxels, of those that are kept
  std::vector<float> sigma;         ///< of each kept voxel, sharpened, 1/world unit
  std::vector<Vec3f> centroids;     ///< of each kept voxel, unit space
  ViewMeans means;                  ///< of each kept voxel
};

RadiancePass::RadiancePass(const ColorField& field, const std::vector<BakeCamera>& cameras,
                           const std::vector<BakeLevel>& levels, std::size_t level, const BakeOptions& options)
    : field_(field),
      level_(levels[level]),
      views_(cameras, levels[level].plan, options),
      weight_threshold_(options.weight_threshold),
      sharpening_(options.sharpening),
      faintest_(faintest_density(options.opacity_threshold, level_.plan.voxel_size)),
      keep_unseen_(options.keep_unseen || cameras.empty()) {
  for (std::size_t other = 0; other < levels.size(); ++other) {
    if (other != level) views_.look_through(levels[other].sigma, levels[other].plan);
  }
}

std::vector<BakedVoxel> RadiancePass::bake_plane(std::span<const DenseVoxel> dense, int plane) const {
  std::vector<std::span<const DenseVoxel>> bricks;
  for (std::size_t begin = 0, end = 0; begin < dense.size(); begin = end) {
    while (end < dense.size() && dense[end].brick == dense[begin].brick) ++end;
    bricks.push_back(dense.subspan(begin, end - begin));
  }
  std::vector<std::vector<BakedVoxel>> baked(bricks.size());
  parallel_tasks(bricks.size(), [&](std::size_t b) { baked[b] = bake_brick(bricks[b], plane); });
  std::vector<BakedVoxel> voxels;
  for (const std::vector<BakedVoxel>& brick : baked) voxels.insert(voxels.end(), brick.begin(), brick.end());
  sort_voxels(voxels);
  return voxels;
}

std::vector<BakedVoxel> RadiancePass::bake_brick(std::span<const DenseVoxel> dense, int plane) const {
  const Vec3i brick_min = brick_min_of(level_.plan, plane, dense.front().brick);
  const Queries queries = gather(dense, brick_min);
  if (queries.voxels.empty()) return {};
  const std::vector<float> luminance = queries.means.luminance(field_);
  const std::vector<Chromaticity> chromaticity = ask_chromaticity(queries);

  std::vector<BakedVoxel> voxels;
  for (std::size_t v = 0; v < queries.voxels.size(); ++v) {
    const DenseVoxel& voxel = dense[queries.voxels[v]];
    const Vec3i at = brick_min + brick_local(voxel.offset);
    const VoxelColor color = voxel_color(luminance[v], chromaticity[v]);
    voxels.push_back({at.x, at.y, at.z, queries.sigma[v], luminance_of(color.rgb), color.rgb, color.a, color.b});
  }
  return voxels;
}

RadiancePass::Queries RadiancePass::gather(std::span<const DenseVoxel> dense, Vec3i brick_min) const {
  constexpr double kHalf = kBrickSide / 2.0;
  const BakePlan& plan = level_.plan;
  const Vec3d centre = plan.world_from_voxel(brick_min.cast<double>() + Vec3d{kHalf, kHalf, kHalf});
  const std::vector<int> order = views_.try_order(centre);
  Queries queries;
  for (std::size_t v = 0; v < dense.size(); ++v) {
    const double opacity = -std::expm1(-dense[v].sigma * plan.voxel_size);
    const auto least = static_cast<float>(weight_threshold_ / opacity);
    if (least > 1 && !keep_unseen_) continue;
    const Vec3i voxel = brick_min + brick_local(dense[v].offset);
    const Vec3d world = plan.world_from_voxel(voxel.cast<double>() + dense[v].centroid_in_voxel());
    const std::vector<SeenBy> seen = views_.seen_by(level_.sigma, world, order, keep_unseen_ ? 0 : least);
    if (seen.empty() && !keep_unseen_) continue;
    const Vec3f unit = field_.frame().unit_from_world(world).cast<float>();
    for (const SeenBy& view : seen) {
      queries.means.look_along(unit, views_.direction_to(view.camera, world), view.transmittance);
    }
    if (seen.empty()) queries.means.look_from_all_sides(unit);
    queries.means.next_point();
    queries.voxels.push_back(v);
    const float sigma = sharpening_ > 0 ? sharpened_density(level_, voxel, sharpening_) : dense[v].sigma;
    queries.sigma.push_back(sigma < faintest_ ? 0.0f : sigma);
    queries.centroids.push_back(unit);
  }
  return queries;
}

std::vector<Chromaticity> RadiancePass::ask_chromaticity(const Queries& queries) const {
  std::vector<Chromaticity> answers(queries.centroids.size());
  field_.query_chromaticity(queries.centroids, answers);
  for (const Chromaticity& c : answers) {
    CNERF_CHECK(std::isfinite(c.x) && std::isfinite(c.z), "the field answered a chromaticity that is not finite");
  }
  return answers;
}

}  // namespace cnerf
