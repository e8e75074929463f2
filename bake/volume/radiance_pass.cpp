#include "bake/volume/radiance_pass.h"

#include <algorithm>
#include <cmath>

#include "bake/color/view_means.h"
#include "bake/color/voxel_color.h"
#include "bake/density/sharpen.h"
#include "bake/volume/dilate.h"
#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"

namespace cnerf::bake {
/// Voxels of a brick that may be kept.
struct RadiancePass::Candidates {
  std::vector<Vec3i> voxels;
  std::vector<float> sigma;  ///< as it was baked, 1/world unit
  std::vector<Sight> sights;
  std::vector<std::int32_t> order;  ///< of cameras, for them all
};

/// Those that a camera sees, and what is asked of the field for them.
struct RadiancePass::Kept {
  std::vector<Voxel> voxels;     ///< colours are still missing
  std::vector<Vec3f> centroids;  ///< unit space
  ViewMeans means;

  void append(const Kept& others) {
    voxels.insert(voxels.end(), others.voxels.begin(), others.voxels.end());
    centroids.insert(centroids.end(), others.centroids.begin(), others.centroids.end());
    means.append(others.means);
  }
};

RadiancePass::RadiancePass(const ColorField& field, const std::vector<Level>& levels, std::size_t level,
                           const ViewSelection& views, const Options& options)
    : field_(field),
      level_(levels[level]),
      level_number_(level),
      views_(views),
      weight_threshold_(options.weight_threshold),
      sharpening_(options.sharpening),
      faintest_(faintest_density(options.opacity_threshold, level_.plan.voxel_size)),
      keep_unseen_(options.keep_unseen || views.eyes().empty()) {}

std::vector<Voxel> RadiancePass::bake_plane(std::span<const DenseVoxel> dense, int plane) const {
  const std::size_t most = kViewsAtATime / std::size_t(views_.views_per_voxel());
  std::vector<Voxel> voxels;
  std::vector<std::span<const DenseVoxel>> bricks;
  std::size_t waiting = 0;
  for (std::size_t begin = 0, end = 0; begin < dense.size(); begin = end) {
    while (end < dense.size() && dense[end].brick == dense[begin].brick) ++end;
    bricks.push_back(dense.subspan(begin, end - begin));
    waiting += end - begin;
    if (waiting < most && end < dense.size()) continue;
    bake_bricks(bricks, plane, voxels);
    bricks.clear();
    waiting = 0;
  }
  sort_voxels(voxels);
  return voxels;
}

void RadiancePass::bake_bricks(std::span<const std::span<const DenseVoxel>> bricks, int plane,
                               std::vector<Voxel>& voxels) const {
  Kept kept = seen_of(bricks, plane);
  const std::vector<float> luminance = kept.means.luminance(field_);
  const std::vector<Chromaticity> chromaticity = ask_chromaticity(kept.centroids);
  parallel_ranges(kept.voxels.size(), kBrickVoxels, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const VoxelColor color = voxel_color(luminance[v], chromaticity[v]);
      Voxel& voxel = kept.voxels[v];
      voxel.luminance = luminance_of(color.rgb);
      voxel.rgb = color.rgb;
      voxel.a = color.a;
      voxel.b = color.b;
    }
  });
  voxels.insert(voxels.end(), kept.voxels.begin(), kept.voxels.end());
}

RadiancePass::Kept RadiancePass::seen_of(std::span<const std::span<const DenseVoxel>> bricks, int plane) const {
  std::vector<Candidates> candidates(bricks.size());
  parallel_tasks(bricks.size(), [&](std::size_t b) { candidates[b] = candidates_of(bricks[b], plane); });
  SightBatch batch;
  std::vector<std::size_t> first;  // sight of each brick
  for (std::uint32_t b = 0; b < candidates.size(); ++b) {
    first.push_back(batch.sights.size());
    for (Sight sight : candidates[b].sights) {
      sight.order = b;
      batch.sights.push_back(sight);
    }
    batch.orders.insert(batch.orders.end(), candidates[b].order.begin(), candidates[b].order.end());
  }
  SeenBatch seen;
  views_.find(level_number_, batch, seen);

  std::vector<Kept> of_bricks(bricks.size());
  parallel_tasks(bricks.size(), [&](std::size_t b) { of_bricks[b] = kept_of(candidates[b], seen, first[b]); });
  Kept kept;
  for (const Kept& of_brick : of_bricks) kept.append(of_brick);
  return kept;
}

RadiancePass::Candidates RadiancePass::candidates_of(std::span<const DenseVoxel> brick, int plane) const {
  constexpr double kHalf = kBrickSide / 2.0;
  const Plan& plan = level_.plan;
  const Vec3i brick_min = brick_min_of(plan, plane, brick.front().brick);
  const Vec3d centre = plan.world_from_voxel(brick_min.cast<double>() + Vec3d{kHalf, kHalf, kHalf});
  Candidates candidates;
  candidates.order = try_order(views_.eyes(), centre);
  for (const DenseVoxel& voxel : brick) {
    const double opacity = -std::expm1(-voxel.sigma * plan.voxel_size);
    const auto least = float(weight_threshold_ / opacity);
    if (least > 1 && !keep_unseen_) continue;
    const Vec3i at = brick_min + brick_local(voxel.offset);
    const Vec3d world = plan.world_from_voxel(at.cast<double>() + voxel.centroid_in_voxel());
    candidates.voxels.push_back(at);
    candidates.sigma.push_back(voxel.sigma);
    candidates.sights.push_back({world, keep_unseen_ ? 0 : least});
  }
  return candidates;
}

RadiancePass::Kept RadiancePass::kept_of(const Candidates& candidates, const SeenBatch& seen, std::size_t first) const {
  Kept kept;
  for (std::size_t c = 0; c < candidates.voxels.size(); ++c) {
    const std::int32_t count = seen.counts[first + c];
    if (count == 0 && !keep_unseen_) continue;
    const Vec3d world = candidates.sights[c].world;
    const Vec3f unit = field_.frame().unit_from_world(world).cast<float>();
    const SeenBy* views = seen.seen.data() + (first + c) * std::size_t(views_.views_per_voxel());
    for (const SeenBy& view : std::span(views, std::size_t(count))) {
      kept.means.look_along(unit, direction_to(views_.eyes()[view.camera], world), view.transmittance);
    }
    if (count == 0) kept.means.look_from_all_sides(unit);
    kept.means.next_point();
    kept.centroids.push_back(unit);
    const Vec3i at = candidates.voxels[c];
    const float sigma = sharpening_ > 0 ? sharpened_density(level_, at, sharpening_) : candidates.sigma[c];
    kept.voxels.push_back({at.x, at.y, at.z, sigma < faintest_ ? 0.0f : sigma});
  }
  return kept;
}

std::vector<Chromaticity> RadiancePass::ask_chromaticity(std::span<const Vec3f> points) const {
  std::vector<Chromaticity> answers(points.size());
  parallel_ranges(points.size(), field_.points_at_a_time(), [&](std::size_t begin, std::size_t end) {
    field_.query_chromaticity(points.subspan(begin, end - begin), std::span(answers).subspan(begin, end - begin));
  });
  for (const Chromaticity& c : answers) {
    CNERF_CHECK(std::isfinite(c.x) && std::isfinite(c.z), "the field answered a chromaticity that is not finite");
  }
  return answers;
}

}  // namespace cnerf::bake
