#include "bake/splat/bake_splats.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "bake/splat/fit.h"
#include "bake/splat/place.h"
#include "src/base/error.h"

namespace cnerf::bake {
namespace {

constexpr double kTargetShare = 0.25;  ///< of the progress line

void report(Observer& observer, double fraction, std::vector<std::pair<std::string, double>> figures = {}) {
  if (observer.is_cancelled()) throw Interrupted("bake stopped: the splats were not written, run it again");
  observer.report_progress({"splats", fraction, std::move(figures)});
}

std::vector<Splat> fitted(const std::vector<SplatTarget>& targets, const std::vector<PlacedSplat>& placed,
                          const SplatJob& job, Observer& observer) {
  SplatOptions options = job.options;
  options.count = splats_in_all(options, placed.size());
  SplatFit fit(targets, placed, options, nearest_splat(job.frame));
  double psnr = 0;
  while (fit.steps_done() < job.options.steps) {
    const double of_picture = fit.step();
    psnr = fit.steps_done() == 1 ? of_picture : 0.95 * psnr + 0.05 * of_picture;
    const double done = double(fit.steps_done()) / job.options.steps;
    report(observer, kTargetShare + (1 - kTargetShare) * done, {{"psnr", psnr}});
  }
  return fit.result();
}

/// Along a curve that keeps neighbours together (Morton 1966), so that files compress.
void sort_in_space(std::vector<Splat>& splats, const SceneFrame& frame) {
  constexpr int kBits = 16;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keys;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const Vec3d unit = frame.unit_from_world(splats[i].position.cast<double>());
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const auto cell = std::uint64_t(std::clamp(unit[axis], 0.0, 1.0) * ((1 << kBits) - 1));
      for (int bit = 0; bit < kBits; ++bit) key |= (cell >> bit & 1) << (3 * bit + axis);
    }
    keys.emplace_back(key, std::uint32_t(i));
  }
  std::ranges::sort(keys);
  std::vector<Splat> sorted;
  sorted.reserve(splats.size());
  for (const auto& [key, i] : keys) sorted.push_back(splats[i]);
  splats = std::move(sorted);
}

}  // namespace

double nearest_splat(const SceneFrame& frame) {
  return 0.005 / frame.unit_per_world;
}

SplatCloud bake_splats(const SplatJob& job, Observer& observer) {
  const std::vector<Camera> cameras = target_cameras(job.cameras);
  const std::vector<SplatTarget> targets = draw_targets(cameras, job.draw, job.options.picture_side,
                                                        [&](double share) { report(observer, kTargetShare * share); });
  const std::vector<PlacedSplat> placed = place_splats(targets, splats_at_first(job.options));
  observer.say(fmt::format("splats: {} placed on what {} pictures of {} x {} show", placed.size(), targets.size(),
                           targets.front().intrinsics.width, targets.front().intrinsics.height));
  SplatCloud cloud{fitted(targets, placed, job, observer), job.frame};
  sort_in_space(cloud.splats, job.frame);
  return cloud;
}

}  // namespace cnerf::bake
