#include "bake/volume/bake_volumes.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>

#include "bake/color/point_color.h"
#include "bake/density/density_pass.h"
#include "bake/progress.h"
#include "bake/volume/dilate.h"
#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"

namespace cnerf::bake {
namespace {

/// Voxels of a brick that may be kept.
struct Candidates {
  std::vector<Vec3i> voxels;
  std::vector<float> sigma;  ///< as it was baked, 1/world unit
  std::vector<Sight> sights;
  std::vector<std::int32_t> order;  ///< of cameras, for them all
};

/// Those that a camera sees, and what is asked of the field for them.
struct Kept {
  std::vector<Voxel> voxels;     ///< colours are still missing
  std::vector<Vec3f> centroids;  ///< unit space
  ViewMeans means;

  void append(const Kept& others) {
    voxels.insert(voxels.end(), others.voxels.begin(), others.voxels.end());
    centroids.insert(centroids.end(), others.centroids.begin(), others.centroids.end());
    means.append(others.means);
  }
};

/// Second pass over one level of a bake. Voxels that no camera sees are left out unless `keep_unseen`. So are those
/// that give less than `weight_threshold` of a pixel's light (transmittance times opacity) even to the camera that sees
/// them best. Luminance is the mean over the cameras that see the voxel, weighted by transmittance; where none does,
/// and everywhere when there are no cameras, over the six axis directions. Light passes through density as it was
/// baked, but what voxels are given is sharpened. Those fainter than `opacity_threshold` then keep their colour alone,
/// which is better than that of a neighbour.
class RadiancePass {
 public:
  /// @param levels  all levels of the bake; `level` is the one to bake, the others stand in its light
  /// @param views   who sees the points of these levels.  All three must outlive this object.
  RadiancePass(const ColorField& field, const std::vector<Level>& levels, std::size_t level, const ViewSelection& views,
               const Options& options);

  /// The voxels of a plane of the density pass with their colours, sorted by (i, j, k).
  /// @throws ContractError  when the field answers a luminance or chromaticity that is not finite.
  /// @throws DeviceError    as ViewSelection::find.
  [[nodiscard]] std::vector<Voxel> bake_plane(std::span<const DenseVoxel> dense, int plane) const;

 private:
  void bake_bricks(std::span<const std::span<const DenseVoxel>> bricks, int plane, std::vector<Voxel>& voxels) const;
  [[nodiscard]] Kept seen_of(std::span<const std::span<const DenseVoxel>> bricks, int plane) const;
  [[nodiscard]] Candidates candidates_of(std::span<const DenseVoxel> brick, int plane) const;
  [[nodiscard]] Kept kept_of(const Candidates& candidates, const SeenBatch& seen, std::size_t first) const;

  const ColorField& field_;
  const Level& level_;
  std::size_t level_number_;
  const ViewSelection& views_;
  double weight_threshold_;
  double sharpening_;
  double faintest_;  ///< density that is kept, 1/world unit
  bool keep_unseen_;
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
  const std::vector<Chromaticity> chromaticity = chromaticity_of(field_, kept.centroids);
  parallel_ranges(kept.voxels.size(), kBrickVoxels, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const VoxelColor color = voxel_color(luminance[v], chromaticity[v], field_.gain());
      Voxel& voxel = kept.voxels[v];
      voxel.luminance = luminance_of(color.rgb);
      voxel.rgb = color.rgb;
      voxel.a = color.a;
      voxel.b = color.b;
    }
  });
  voxels.insert(voxels.end(), kept.voxels.begin(), kept.voxels.end());
}

Kept RadiancePass::seen_of(std::span<const std::span<const DenseVoxel>> bricks, int plane) const {
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

Candidates RadiancePass::candidates_of(std::span<const DenseVoxel> brick, int plane) const {
  constexpr double kHalf = kBrickSide / 2.0;
  const Plan& plan = level_.plan;
  const Vec3i brick_min = brick_min_of(plan, plane, brick.front().brick);
  const Vec3d centre = plan.world_from_voxel(brick_min.cast<double>() + Vec3d{kHalf, kHalf, kHalf});
  Candidates candidates;
  candidates.order = views_.order_for(centre, std::sqrt(3) * kHalf * plan.voxel_size);
  const bool is_hidden = candidates.order.empty() || candidates.order.front() < 0;
  if (is_hidden && !keep_unseen_) return candidates;
  for (const DenseVoxel& voxel : brick) {
    const double opacity = -std::expm1(-voxel.sigma * plan.voxel_size);
    const auto least = float(weight_threshold_ / opacity);
    if (least > 1 && !keep_unseen_) continue;
    const Vec3i at = brick_min + brick_local(voxel.offset);
    const Vec3d world = plan.world_from_voxel(at.cast<double>() + voxel.centroid_in_voxel());
    candidates.voxels.push_back(at);
    candidates.sigma.push_back(voxel.sigma);
    candidates.sights.push_back({world, keep_unseen_ ? 0 : least, 0});
  }
  return candidates;
}

Kept RadiancePass::kept_of(const Candidates& candidates, const SeenBatch& seen, std::size_t first) const {
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

/// Whether voxels can be what a plane of a plan came to: in order, inside of the lattice, of finite values.
bool is_plane_of(const Plan& plan, std::size_t plane, const std::vector<Voxel>& voxels) {
  const Vec3i low{int(plane) * kBrickSide, 0, 0};
  const Vec3i size = plane_bricks(plan) * kBrickSide;
  const auto is_sound = [&](const Voxel& voxel) {
    const Vec3i at = Vec3i{voxel.i, voxel.j, voxel.k};
    for (int axis = 0; axis < 3; ++axis) {
      if (at[axis] < low[axis] || at[axis] >= low[axis] + size[axis]) return false;
    }
    return is_valid(voxel);
  };
  const auto is_not_before = [](const Voxel& a, const Voxel& b) {
    return std::tie(a.i, a.j, a.k) >= std::tie(b.i, b.j, b.k);
  };
  return std::ranges::all_of(voxels, is_sound) && std::ranges::adjacent_find(voxels, is_not_before) == voxels.end();
}

}  // namespace

std::vector<VolumePlanes> bake_volumes(const ColorField& field, const ViewSelection& views,
                                       const std::vector<Level>& levels, const Options& options, Journal& journal,
                                       const ProgressSink& sink) {
  const std::size_t planes_of_density = plane_count(levels);
  const PassProgress progress = volume_progress(sink, kDensityPassShare, 1);
  std::size_t done = 0;
  std::vector<VolumePlanes> volumes;
  std::size_t dense_first = 0;
  for (std::size_t level = 0; level < levels.size(); ++level) {
    const Plan& plan = levels[level].plan;
    const RadiancePass pass(field, levels, level, views, options);
    const auto planes = std::size_t(plane_count(plan));
    const std::size_t first = planes_of_density + dense_first;
    VolumePlanes volume;
    static_cast<VolumeHeader&>(volume) = {plan.origin, plan.voxel_size, plan.resolution, field.frame()};
    volume.end = int(planes);
    volume.is_sparing = !options.max_memory.empty();
    journal.parts<Voxel>(
        first, planes, planes_at_a_time(options),
        [&](std::size_t plane) { return pass.bake_plane(journal.read<DenseVoxel>(dense_first + plane), int(plane)); },
        [&](std::size_t, const std::vector<Voxel>& voxels) {
          volume.statistics.add(voxels);
          progress.report(double(++done) / double(planes_of_density));
        },
        [&](std::size_t plane, const std::vector<Voxel>& voxels) { return is_plane_of(plan, plane, voxels); });
    dense_first += planes;
    if (volume.statistics.dense.is_empty()) continue;  // colours of nothing are no volume
    volume.read = [&journal, first, end = volume.end](int plane) {
      if (plane < 0 || plane >= end) return std::vector<Voxel>();
      return journal.read<Voxel>(first + std::size_t(plane));
    };
    volumes.push_back(std::move(volume));
  }
  if (volumes.empty()) {
    throw InputError("bake: no camera sees anything inside the box; check --aabb or use --keep-unseen");
  }
  return volumes;
}

}  // namespace cnerf::bake
