#include "src/prepare/sparse_points.h"

#include <fmt/format.h>

#include <algorithm>

#include "src/base/statistics.h"
#include "src/base/text.h"
#include "src/base/usage.h"
#include "src/prepare/feature_tracks.h"

namespace cnerf::prepare {
namespace {

constexpr double kTolerance = 4;  // pixels
// Pixels. Half a degree or a focal length 3 % off has 1.1 to 1.6; cameras that are right have 0.5 to 0.8.
constexpr double kInexact = 1;

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
  if (job.options.poses || job.options.lenses) return points;
  std::vector<double> errors;
  for (const SparsePoint& point : points) errors.push_back(point.error);
  if (const double off = errors.empty() ? 0 : median(std::move(errors)); off > kInexact) {
    observer.say(
        fmt::format("note: they are {:.1f} pixels off where views show them, so cameras may be inexact: "
                    "--set stage1.poses=true --set stage1.lenses=true adjusts them first",
                    off));
  }
  return points;
}

}  // namespace cnerf::prepare
