#include "src/prepare/sparse_points.h"

#include <fmt/format.h>

#include <algorithm>

#include "src/base/text.h"
#include "src/base/usage.h"
#include "src/prepare/feature_tracks.h"

namespace cnerf::prepare {
namespace {

constexpr double kTolerance = 4;  // pixels

}  // namespace

std::vector<SparsePoint> find_sparse_points(const Capture& capture, Observer& observer) {
  std::vector<SparsePoint> points;
  for (const Track& track : FeatureTracks(capture, observer).triangulated(capture, kTolerance, observer)) {
    points.push_back(point_of(track));
  }
  return points;
}

bool has_seen_points(const Capture& capture) {
  return std::ranges::any_of(
      capture.points, [](const SparsePoint& point) { return point.views.size() >= FeatureTracks::kFewestViews; });
}

std::vector<SparsePoint> points_for_training(const Stage1Job& job, Observer& observer) {
  const Capture& capture = job.capture;
  const bool asks_for_points = job.options.free_space || job.options.depth_weight > 0;
  if (!asks_for_points || capture.is_bounded_object || has_seen_points(capture)) return {};
  const Stopwatch watch;
  std::vector<SparsePoint> points = find_sparse_points(capture, observer);
  observer.say(fmt::format("{} sparse points found in {}", points.size(), duration_text(watch.seconds())));
  return points;
}

}  // namespace cnerf::prepare
