#include "bake/color/view_average.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "bake/color/point_color.h"
#include "bake/density/nested.h"
#include "bake/visibility/view_selection.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

constexpr std::size_t kMostOrders = std::size_t(1) << 22;  ///< cameras of all orders in a question

}  // namespace

struct ViewAverage::Brick {
  std::size_t level = 0;
  Vec3d centre{};                   // world
  std::vector<std::size_t> points;  // of the positions asked for
};

ViewAverage::ViewAverage(const ColorField& field, std::unique_ptr<const std::vector<Level>> levels,
                         std::unique_ptr<const ViewSelection> views)
    : field_(field), levels_(std::move(levels)), views_(std::move(views)) {}

std::size_t ViewAverage::level_of(Vec3d world) const {
  for (std::size_t level = 0; level + 1 < levels_->size(); ++level) {
    const Plan& plan = (*levels_)[level].plan;
    const Vec3d p = plan.voxel_from_world(world);
    const Aabbd lattice{{0, 0, 0}, plan.resolution.cast<double>()};
    if (lattice.contains(p) && !plan.in_hole(p.cast<int>())) return level;
  }
  return levels_->size() - 1;
}

std::vector<ViewAverage::Brick> ViewAverage::by_brick(std::span<const Vec3f> positions) const {
  using Key = std::pair<std::size_t, std::array<int, 3>>;
  constexpr double kSide = kBrickSide;  // voxels
  std::map<Key, Brick> bricks;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Vec3d world = field_.frame().world_from_unit(positions[i].cast<double>());
    const std::size_t level = level_of(world);
    const Plan& plan = (*levels_)[level].plan;
    const Vec3d p = plan.voxel_from_world(world) / kSide;
    const std::array<int, 3> at{int(std::floor(p.x)), int(std::floor(p.y)), int(std::floor(p.z))};
    Brick& brick = bricks[{level, at}];
    brick.level = level;
    brick.centre = plan.world_from_voxel(Vec3d{at[0] + 0.5, at[1] + 0.5, at[2] + 0.5} * kSide);
    brick.points.push_back(i);
  }
  std::vector<Brick> list;
  for (auto& [key, brick] : bricks) list.push_back(std::move(brick));
  return list;
}

void ViewAverage::ask(std::span<const Brick> bricks, std::span<const Vec3f> positions,
                      std::span<float> luminance) const {
  const std::vector<Eye>& eyes = views_->eyes();
  SightBatch batch;
  std::vector<std::size_t> points;  // in the order of the sights
  for (std::uint32_t b = 0; b < bricks.size(); ++b) {
    for (const std::size_t point : bricks[b].points) {
      points.push_back(point);
      batch.sights.push_back({field_.frame().world_from_unit(positions[point].cast<double>()), 0, b});
    }
  }
  batch.orders.resize(bricks.size() * eyes.size());
  parallel_tasks(bricks.size(), [&](std::size_t b) {
    std::ranges::copy(try_order(eyes, bricks[b].centre), batch.orders.begin() + std::ptrdiff_t(b * eyes.size()));
  });
  SeenBatch seen;
  views_->find(bricks.front().level, batch, seen);

  ViewMeans means;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3f position = positions[points[i]];
    const SeenBy* views = seen.seen.data() + i * std::size_t(views_->views_per_voxel());
    for (const SeenBy& view : std::span(views, std::size_t(seen.counts[i]))) {
      means.look_along(position, direction_to(eyes[view.camera], batch.sights[i].world), view.transmittance);
    }
    if (seen.counts[i] == 0) means.look_from_all_sides(position);
    means.next_point();
  }
  const std::vector<float> answers = means.luminance(field_);
  for (std::size_t i = 0; i < points.size(); ++i) luminance[points[i]] = answers[i];
}

void ViewAverage::query(std::span<const Vec3f> positions, std::span<float> luminance) const {
  const std::vector<Brick> bricks = by_brick(positions);
  const std::size_t most = kViewsAtATime / std::size_t(views_->views_per_voxel());
  for (std::size_t begin = 0, end = 0; begin < bricks.size(); begin = end) {
    std::size_t count = 0;
    while (end < bricks.size() && bricks[end].level == bricks[begin].level && count < most &&
           (end - begin) * views_->eyes().size() < kMostOrders) {
      count += bricks[end++].points.size();
    }
    ask(std::span(bricks).subspan(begin, end - begin), positions, luminance);
  }
}

std::unique_ptr<ViewAverage> make_view_average(const ColorField& field, const std::vector<Camera>& cameras,
                                               const Options& options, const Engines& engines, Observer& observer) {
  Journal journal;
  auto levels = std::make_unique<const std::vector<Level>>(
      bake_levels(field, plan_within_budget(field, cameras, options), options, journal, observer.progress_sink()));
  auto views = select_views(cameras, density_levels(*levels), options, engines, observer);
  return std::make_unique<ViewAverage>(field, std::move(levels), std::move(views));
}

}  // namespace cnerf::bake
