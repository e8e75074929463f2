#include "src/prepare/sparse_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <opencv2/features2d.hpp>
#include <optional>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/base/text.h"
#include "src/base/usage.h"
#include "src/capture/arrangement.h"
#include "src/prepare/grey_image.h"

namespace cnerf::prepare {
namespace {

constexpr int kLongestSide = 1000;     // pixels at which features are looked for; tolerances below are of these pixels
constexpr int kFeatures = 2000;        // of a view, at most
constexpr std::size_t kPartners = 16;  // that a view is matched with
constexpr double kSeesAlike = 0.5;     // cosine of optical axes, below which views are not matched
constexpr double kEpipolarDistance = 4;                       // pixels off the epipolar line
constexpr float kRatio = 0.85f;                               // of the best and second-best distance of descriptors
constexpr double kReprojection = 4;                           // pixels off a picture's feature
constexpr double kLeastAngle = 1.5 * std::numbers::pi / 180;  // between two of a point's rays
constexpr std::size_t kFewestViews = 3;                       // of a point: of two, one in many is a coincidence

struct Feature {
  PixelPosition pixel;  ///< of the view's own picture
  Vec3d direction;      ///< of its ray, world, unit length
};

struct ViewFeatures {
  std::vector<Feature> features;
  cv::Mat1f descriptors;     ///< [features, 128], unit length
  double pixel_angle = 0;    ///< radians that a pixel of `kLongestSide` covers
  double pixel_per_own = 1;  ///< such a pixel's share of one of the view's own
};

/// RootSIFT (Arandjelovic and Zisserman 2012): roots of shares, whose products are similarities.
void take_roots(cv::Mat1f& descriptors) {
  for (int row = 0; row < descriptors.rows; ++row) {
    float* values = descriptors.ptr<float>(row);
    const float sum = std::accumulate(values, values + descriptors.cols, 1e-9f);
    for (int i = 0; i < descriptors.cols; ++i) values[i] = std::sqrt(values[i] / sum);
  }
}

bool shows_scene(const MonoImage& image, PixelPosition at) {
  const int x = std::clamp(int(at.x), 0, image.width - 1), y = std::clamp(int(at.y), 0, image.height - 1);
  const std::size_t index = std::size_t(y) * std::size_t(image.width) + std::size_t(x);
  return image.valid(index) && image.coverage(index) > 0.5f;
}

ViewFeatures features_of(const View& view) {
  const MonoImage& image = view.image;
  const LinearImage luminance{image.width, image.height, 1, image.depth, luminance_plane(image), {}};
  const cv::Mat1b picture = reduced_to(grey_codes(luminance), kLongestSide);
  const double own_per_pixel = double(image.width) / picture.cols;
  std::vector<cv::KeyPoint> points;
  cv::Mat found;
  cv::SIFT::create(kFeatures)->detectAndCompute(picture, cv::noArray(), points, found);
  ViewFeatures out;
  out.pixel_per_own = 1 / own_per_pixel;
  out.pixel_angle = own_per_pixel / view.intrinsics.fx;
  for (int i = 0; i < int(points.size()); ++i) {
    const cv::Point2f at = points[std::size_t(i)].pt;
    // OpenCV's pixels have their middles at whole numbers.
    const PixelPosition pixel{(at.x + 0.5) * own_per_pixel, (at.y + 0.5) * own_per_pixel};
    if (!shows_scene(image, pixel)) continue;
    const Vec3d direction = normalized(view.world_from_camera.direction(ray_direction(view.intrinsics, pixel)));
    out.features.push_back({pixel, direction});
    out.descriptors.push_back(cv::Mat1f(found.row(i)));
  }
  take_roots(out.descriptors);
  return out;
}

Vec3d centre_of(const View& view) {
  return view.world_from_camera.translation;
}
Vec3d axis_of(const View& view) {
  return view.world_from_camera.linear.column(2);
}

/// Each view with the nearest ones that look its way.
std::vector<std::pair<std::size_t, std::size_t>> pairs_of(const Capture& capture) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t a = 0; a < capture.views.size(); ++a) {
    if (capture.views[a].held_out) continue;
    std::vector<std::pair<double, std::size_t>> partners;
    for (std::size_t b = 0; b < capture.views.size(); ++b) {
      const bool is_partner = b != a && !capture.views[b].held_out &&
                              dot(axis_of(capture.views[a]), axis_of(capture.views[b])) > kSeesAlike;
      if (is_partner) partners.emplace_back(length(centre_of(capture.views[a]) - centre_of(capture.views[b])), b);
    }
    std::ranges::sort(partners);
    for (std::size_t k = 0; k < std::min(kPartners, partners.size()); ++k) {
      pairs.emplace_back(std::minmax(a, partners[k].second));
    }
  }
  std::ranges::sort(pairs);
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

using Match = std::pair<int, int>;

/// The best partner of each row of `similarity` among those allowed, where it is clearly the best; else -1.
std::vector<int> best_of_rows(const cv::Mat1f& similarity) {
  std::vector<int> best(std::size_t(similarity.rows), -1);
  for (int row = 0; row < similarity.rows; ++row) {
    const float* values = similarity.ptr<float>(row);
    float first = -1, second = -1;
    for (int i = 0; i < similarity.cols; ++i) {
      if (values[i] > first) {
        second = first;
        first = values[i];
        best[std::size_t(row)] = i;
      } else {
        second = std::max(second, values[i]);
      }
    }
    // Distances of unit vectors: |a - b|^2 = 2 - 2 a b.
    const bool is_clear = first > 0 && 2 - 2 * first < kRatio * kRatio * (2 - 2 * std::max(second, 0.0f));
    if (!is_clear) best[std::size_t(row)] = -1;
  }
  return best;
}

/// Each the other's best of those near the epipolar line.
std::vector<Match> match(const ViewFeatures& a, const ViewFeatures& b, Vec3d baseline) {
  std::vector<Match> matches;
  if (a.features.empty() || b.features.empty() || !(length(baseline) > 0)) return matches;
  cv::Mat1f similarity = a.descriptors * b.descriptors.t();
  const double tolerance = kEpipolarDistance * std::max(a.pixel_angle, b.pixel_angle);
  for (int i = 0; i < similarity.rows; ++i) {
    const Vec3d across = cross(baseline, a.features[std::size_t(i)].direction);
    const Vec3d normal = across / std::max(length(across), 1e-12);
    float* values = similarity.ptr<float>(i);
    for (int j = 0; j < similarity.cols; ++j) {
      if (std::abs(dot(normal, b.features[std::size_t(j)].direction)) > tolerance) values[j] = -1;
    }
  }
  const std::vector<int> forward = best_of_rows(similarity), back = best_of_rows(similarity.t());
  for (int i = 0; i < int(forward.size()); ++i) {
    const int j = forward[std::size_t(i)];
    if (j >= 0 && back[std::size_t(j)] == i) matches.emplace_back(i, j);
  }
  return matches;
}

/// A feature of a view.
struct Sighting {
  std::uint32_t view = 0, feature = 0;
};

/// Makes points of matches. A point starts with two features that match and takes in what matches its features, as long
/// as it lies where the point is seen: a wrong match costs a sighting, it does not join two points.
class Triangulator {
 public:
  Triangulator(const Capture& capture, const std::vector<ViewFeatures>& views) : capture_(capture), views_(views) {
    for (const View& view : capture.views) camera_from_world_.push_back(view.world_from_camera.inverse());
    for (const ViewFeatures& view : views) {
      partners_.emplace_back(view.features.size());
      is_used_.emplace_back(view.features.size(), false);
    }
  }

  void add(Sighting a, Sighting b) {
    partners_of(a).push_back(b);
    partners_of(b).push_back(a);
    const double angle = std::acos(std::clamp(dot(ray_of(a).direction, ray_of(b).direction), -1.0, 1.0));
    if (angle > kLeastAngle) starts_.push_back({angle, a, b});
  }

  /// Pairs that look at their point from the most different sides know best where it is, and come first.
  [[nodiscard]] std::vector<SparsePoint> points() {
    std::ranges::stable_sort(starts_, std::ranges::greater{}, &Start::angle);
    std::vector<SparsePoint> points;
    for (const Start& start : starts_) {
      if (is_used(start.a) || is_used(start.b)) continue;
      const std::vector<Sighting> sightings = grown({start.a, start.b});
      if (sightings.size() < kFewestViews) continue;
      for (const Sighting& sighting : sightings) is_used_[sighting.view][sighting.feature] = true;
      points.push_back(point_of(sightings));
    }
    return points;
  }

 private:
  struct Start {
    double angle;
    Sighting a, b;
  };

  /// All that agree with a point of these, one per view; fewer than two where they do not agree themselves.
  [[nodiscard]] std::vector<Sighting> grown(std::vector<Sighting> sightings) const {
    constexpr int kMostRounds = 10;  // one may come and go for ever
    std::size_t before = 0;
    for (int round = 0; before != sightings.size() && round < kMostRounds; ++round) {
      before = sightings.size();
      const auto position = position_of(sightings);
      if (!position) return {};
      std::erase_if(sightings, [&](Sighting each) { return error_of(each, *position) > kReprojection; });
      if (sightings.size() < before) continue;  // once more without them
      for (std::size_t i = 0; i < sightings.size(); ++i) take_partners(sightings[i], *position, sightings);
    }
    return sightings;
  }
  void take_partners(Sighting of, Vec3d position, std::vector<Sighting>& sightings) const {
    for (const Sighting partner : partners_[of.view][of.feature]) {
      const bool is_new =
          !is_used(partner) && std::ranges::find(sightings, partner.view, &Sighting::view) == sightings.end();
      if (is_new && error_of(partner, position) < kReprojection) sightings.push_back(partner);
    }
  }

  [[nodiscard]] std::optional<Vec3d> position_of(const std::vector<Sighting>& sightings) const {
    if (sightings.size() < 2) return std::nullopt;
    std::vector<WorldRay> rays;
    for (const Sighting sighting : sightings) rays.push_back(ray_of(sighting));
    return nearest_point(rays, 0);
  }
  [[nodiscard]] WorldRay ray_of(Sighting sighting) const {
    return {centre_of(capture_.views[sighting.view]), views_[sighting.view].features[sighting.feature].direction};
  }
  /// Pixels of `kLongestSide`; huge behind the camera.
  [[nodiscard]] double error_of(Sighting sighting, Vec3d position) const {
    const auto seen =
        project(capture_.views[sighting.view].intrinsics, camera_from_world_[sighting.view].point(position));
    if (!seen) return 1e9;
    const PixelPosition at = views_[sighting.view].features[sighting.feature].pixel;
    return std::hypot(seen->x - at.x, seen->y - at.y) * views_[sighting.view].pixel_per_own;
  }
  [[nodiscard]] SparsePoint point_of(const std::vector<Sighting>& sightings) const {
    SparsePoint point{*position_of(sightings), 0, {}};
    for (const Sighting sighting : sightings) {
      point.error += error_of(sighting, point.position) / double(sightings.size());
      point.views.push_back(sighting.view);
    }
    std::ranges::sort(point.views);
    return point;
  }

  std::vector<Sighting>& partners_of(Sighting of) { return partners_[of.view][of.feature]; }
  [[nodiscard]] bool is_used(Sighting of) const { return is_used_[of.view][of.feature]; }

  const Capture& capture_;
  const std::vector<ViewFeatures>& views_;
  std::vector<Affined> camera_from_world_;
  std::vector<std::vector<std::vector<Sighting>>> partners_;  ///< [view][feature]
  std::vector<std::vector<bool>> is_used_;                    ///< [view][feature]
  std::vector<Start> starts_;
};

/// Tasks of about a second, between which the observer is asked: it hears from one thread alone.
template <typename Task>
void in_parts(std::size_t tasks, const std::string& name, std::pair<double, double> share, Observer& observer,
              const Task& task) {
  const std::size_t part = 8 * std::size_t(thread_count());
  for (std::size_t begin = 0; begin < tasks; begin += part) {
    if (observer.is_cancelled()) throw Interrupted("stopped while looking for sparse points");
    const double done = double(begin) / double(tasks);
    observer.report_progress({name, share.first + done * (share.second - share.first), {}});
    parallel_tasks(std::min(part, tasks - begin), [&](std::size_t i) { task(begin + i); });
  }
  if (observer.is_cancelled()) throw Interrupted("stopped while looking for sparse points");
}

}  // namespace

std::vector<SparsePoint> find_sparse_points(const Capture& capture, Observer& observer) {
  std::vector<ViewFeatures> features(capture.views.size());
  in_parts(features.size(), "features", {0, 0.5}, observer, [&](std::size_t i) {
    if (!capture.views[i].held_out) features[i] = features_of(capture.views[i]);
  });
  const auto pairs = pairs_of(capture);
  std::vector<std::vector<Match>> matches(pairs.size());
  in_parts(pairs.size(), "matches", {0.5, 1}, observer, [&](std::size_t k) {
    const auto [a, b] = pairs[k];
    matches[k] = match(features[a], features[b], centre_of(capture.views[b]) - centre_of(capture.views[a]));
  });
  Triangulator triangulator(capture, features);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const auto [a, b] = pairs[k];
    for (const auto& [of_a, of_b] : matches[k]) {
      triangulator.add({std::uint32_t(a), std::uint32_t(of_a)}, {std::uint32_t(b), std::uint32_t(of_b)});
    }
  }
  return triangulator.points();
}

std::vector<SparsePoint> points_for_training(const Stage1Job& job, Observer& observer) {
  const Capture& capture = job.capture;
  const bool asks_for_points = job.options.free_space || job.options.depth_weight > 0;
  const bool has_points =
      std::ranges::any_of(capture.points, [](const SparsePoint& point) { return point.views.size() >= kFewestViews; });
  if (!asks_for_points || capture.is_bounded_object || has_points) return {};
  const Stopwatch watch;
  std::vector<SparsePoint> points = find_sparse_points(capture, observer);
  observer.say(fmt::format("{} sparse points found in {}", points.size(), duration_text(watch.seconds())));
  return points;
}

}  // namespace cnerf::prepare
