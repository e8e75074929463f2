#include "bake/visibility/view_selection.h"

#include <algorithm>
#include <numeric>
#include <string>

#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

constexpr std::size_t kSpreadViews = 32;  ///< views picked by spread; the rest follows by distance
constexpr std::size_t kSightsAtATime = 256;

}  // namespace

std::vector<Eye> eyes_of(const std::vector<Camera>& cameras) {
  std::vector<Eye> eyes;
  for (const Camera& camera : cameras) {
    eyes.push_back({camera.intrinsics, camera.world_from_camera.inverse(), camera.world_from_camera.translation, {}});
  }
  return eyes;
}

Vec3f direction_to(const Eye& eye, Vec3d world) {
  return normalized(world - eye.centre).cast<float>();
}

std::vector<std::int32_t> try_order(std::span<const Eye> eyes, Vec3d world) {
  const std::size_t n = eyes.size();
  std::vector<Vec3d> directions(n);
  std::vector<double> footprint(n);  // size of a pixel there, world units
  for (std::size_t i = 0; i < n; ++i) {
    const double distance = std::max(length(world - eyes[i].centre), 1e-12);
    directions[i] = (world - eyes[i].centre) / distance;
    footprint[i] = distance / eyes[i].intrinsics.fx;
  }
  std::vector<std::int32_t> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return footprint[a] < footprint[b]; });

  std::vector<double> closest(n, -1);  // largest cosine to a camera picked so far
  for (std::size_t picked = 1; picked < std::min(n, kSpreadViews); ++picked) {
    for (std::size_t i = picked; i < n; ++i) {
      closest[order[i]] = std::max(closest[order[i]], dot(directions[order[i]], directions[order[picked - 1]]));
    }
    const auto farthest = std::min_element(order.begin() + std::ptrdiff_t(picked), order.end(),
                                           [&](int a, int b) { return closest[a] < closest[b]; });
    std::rotate(order.begin() + std::ptrdiff_t(picked), farthest, farthest + 1);
  }
  return order;
}

std::vector<DensityLevel> density_levels(std::span<const Level> levels) {
  std::vector<DensityLevel> result;
  for (const Level& level : levels) result.push_back({&level.sigma, level.plan.origin, level.plan.voxel_size});
  return result;
}

ViewSelection::ViewSelection(const std::vector<Camera>& cameras, std::vector<DensityLevel> levels,
                             const Options& options)
    : eyes_(eyes_of(cameras)), levels_(std::move(levels)), views_per_voxel_(options.views_per_voxel) {
  grids_.reserve(levels_.size());
  for (const DensityLevel& level : levels_) {
    grids_.emplace_back(*level.sigma);
    clear_levels_.push_back({&grids_.back(), level.origin, level.voxel_size});
  }
}

void ViewSelection::map_depths() {
  depth_maps_ = DepthMaps(eyes_, clear_levels_);
  for (std::size_t e = 0; e < eyes_.size(); ++e) eyes_[e].depths = depth_maps_.map(e, depth_maps_.values().data());
}

std::vector<std::int32_t> ViewSelection::order_for(Vec3d centre, double radius) const {
  std::vector<std::int32_t> order = try_order(eyes_, centre);
  if (depth_maps_.is_empty()) return order;
  const auto may_see = [&](std::int32_t eye) {
    return depth_maps_.may_see(std::size_t(eye), eyes_[eye], centre, radius);
  };
  std::fill(std::stable_partition(order.begin(), order.end(), may_see), order.end(), -1);
  return order;
}

SightScene<BrickGrid<float>> ViewSelection::scene() const {
  return {eyes_.data(), int(eyes_.size()), levels_.data(), int(levels_.size()), views_per_voxel_};
}

SightScene<ClearGrid> ViewSelection::clear_scene() const {
  return {eyes_.data(), int(eyes_.size()), clear_levels_.data(), int(clear_levels_.size()), views_per_voxel_};
}

std::vector<SeenBy> ViewSelection::seen_by(std::size_t level, Vec3d world, std::span<const std::int32_t> order,
                                           float least) const {
  std::vector<SeenBy> seen(views_per_voxel_);
  seen.resize(find_seeing(clear_scene(), int(level), {world, least}, order.data(), seen.data()));
  return seen;
}

void ViewSelection::find(std::size_t level, const SightBatch& batch, SeenBatch& answer) const {
  answer.seen.resize(batch.sights.size() * views_per_voxel_);
  answer.counts.resize(batch.sights.size());
  const SightScene<ClearGrid> all = clear_scene();
  parallel_ranges(batch.sights.size(), kSightsAtATime, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Sight& sight = batch.sights[i];
      answer.counts[i] = find_seeing(all, int(level), sight, batch.orders.data() + sight.order * eyes_.size(),
                                     answer.seen.data() + i * views_per_voxel_);
    }
  });
}

std::unique_ptr<ViewSelection> select_views(const std::vector<Camera>& cameras, const std::vector<DensityLevel>& levels,
                                            const Options& options, [[maybe_unused]] const Engines& engines,
                                            [[maybe_unused]] Observer& observer) {
#if CNERF_CUDA_BAKE
  if (engines.device() == Device::kCuda) {
    try {
      return make_view_selection_cuda(cameras, levels, options);
    } catch (const DeviceError& failure) {
      observer.say(std::string("bake: the processor works out which cameras see what, which is slower: ") +
                   failure.what());
    }
  }
#endif
  auto views = std::make_unique<ViewSelection>(cameras, levels, options);
  views->map_depths();
  return views;
}

}  // namespace cnerf::bake
