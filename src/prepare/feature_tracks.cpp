#include "src/prepare/feature_tracks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <opencv2/features2d.hpp>
#include <optional>
#include <span>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/capture/arrangement.h"
#include "src/prepare/grey_image.h"

namespace cnerf::prepare {
namespace {

constexpr int kFeatures = 2000;        // of a view, at most
constexpr std::size_t kPartners = 16;  // that a view is matched with
constexpr double kSeesAlike = 0.5;     // cosine of optical axes, below which views are not matched
constexpr float kRatio = 0.85f;        // of the best and second-best distance of descriptors
constexpr double kLeastAngle = 1.5 * std::numbers::pi / 180;  // between two of a point's rays

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

FeatureTracks::ViewFeatures features_of(const View& view) {
  const MonoImage& image = view.image;
  const LinearImage luminance{image.width, image.height, 1, image.depth, luminance_plane(image), {}};
  const cv::Mat1b picture = reduced_to(grey_codes(luminance), FeatureTracks::kLongestSide);
  const double own_per_pixel = double(image.width) / picture.cols;
  std::vector<cv::KeyPoint> points;
  cv::Mat found;
  cv::SIFT::create(kFeatures)->detectAndCompute(picture, cv::noArray(), points, found);
  FeatureTracks::ViewFeatures out;
  out.pixel_per_own = 1 / own_per_pixel;
  for (int i = 0; i < int(points.size()); ++i) {
    const cv::Point2f at = points[std::size_t(i)].pt;
    // OpenCV's pixels have their middles at whole numbers.
    const PixelPosition pixel{(at.x + 0.5) * own_per_pixel, (at.y + 0.5) * own_per_pixel};
    if (!shows_scene(image, pixel)) continue;
    out.pixels.push_back(pixel);
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

/// The features of a view as rays of its camera.
struct ViewRays {
  std::vector<Vec3d> directions;  ///< world, unit length
  double pixel_angle = 0;         ///< radians that a pixel of `FeatureTracks::kLongestSide` covers
};

ViewRays rays_of(const View& view, const FeatureTracks::ViewFeatures& features) {
  ViewRays rays;
  rays.pixel_angle = 1 / (features.pixel_per_own * view.intrinsics.fx);
  for (const PixelPosition pixel : features.pixels) {
    rays.directions.push_back(normalized(view.world_from_camera.direction(ray_direction(view.intrinsics, pixel))));
  }
  return rays;
}

using Match = std::pair<int, int>;

/// Similarity of descriptors of unit length, of a multiple of 16 values. Sums of lanes, which compilers turn into
/// vector instructions.
float similarity_of(const float* a, const float* b, int values) {
  std::array<float, 16> sums{};
  for (int i = 0; i < values; i += int(sums.size())) {
    for (std::size_t lane = 0; lane < sums.size(); ++lane) sums[lane] += a[i + int(lane)] * b[i + int(lane)];
  }
  return std::accumulate(sums.begin(), sums.end(), 0.0f);
}

/// The likest of the features that a feature was compared with.
class Likest {
 public:
  void compare(int feature, float similarity) {
    if (similarity > first_) {
      second_ = first_;
      first_ = similarity;
      feature_ = feature;
    } else {
      second_ = std::max(second_, similarity);
    }
  }
  /// -1: none is clearly the likest.
  [[nodiscard]] int feature() const {
    // Distances of unit vectors: |a - b|^2 = 2 - 2 a b.
    const bool is_clear = first_ > 0 && 2 - 2 * first_ < kRatio * kRatio * (2 - 2 * std::max(second_, 0.0f));
    return is_clear ? feature_ : -1;
  }

 private:
  int feature_ = -1;
  float first_ = -1, second_ = -1;
};

/// Directions by coordinates, so that a plane is compared with all of them in one sweep.
struct DirectionPlanes {
  explicit DirectionPlanes(const ViewRays& rays) {
    for (const Vec3d& each : rays.directions) {
      x.push_back(float(each.x));
      y.push_back(float(each.y));
      z.push_back(float(each.z));
    }
  }
  /// Sines of the angles between the directions and the plane of this normal.
  void angles_to(Vec3d normal, std::span<float> angles) const {
    const float nx = float(normal.x), ny = float(normal.y), nz = float(normal.z);
    for (std::size_t i = 0; i < angles.size(); ++i) angles[i] = std::abs(nx * x[i] + ny * y[i] + nz * z[i]);
  }

  std::vector<float> x, y, z;
};

/// Each the other's likest of those that lie near its epipolar line. Most pairs do not, and are not compared.
/// @param tolerance  radians
std::vector<Match> matches_of(const FeatureTracks::ViewFeatures& a, const ViewRays& rays_a,
                              const FeatureTracks::ViewFeatures& b, const ViewRays& rays_b, Vec3d baseline,
                              double tolerance) {
  const DirectionPlanes directions(rays_b);
  std::vector<Likest> likest_of_a(rays_a.directions.size()), likest_of_b(rays_b.directions.size());
  std::vector<float> angles(rays_b.directions.size());
  for (std::size_t i = 0; i < likest_of_a.size(); ++i) {
    const Vec3d across = cross(baseline, rays_a.directions[i]);
    directions.angles_to(across / std::max(length(across), 1e-12), angles);
    for (std::size_t j = 0; j < likest_of_b.size(); ++j) {
      if (angles[j] > float(tolerance)) continue;
      const float similarity = similarity_of(a.descriptors[int(i)], b.descriptors[int(j)], a.descriptors.cols);
      likest_of_a[i].compare(int(j), similarity);
      likest_of_b[j].compare(int(i), similarity);
    }
  }
  std::vector<Match> matches;
  for (std::size_t i = 0; i < likest_of_a.size(); ++i) {
    const int j = likest_of_a[i].feature();
    if (j >= 0 && likest_of_b[std::size_t(j)].feature() == int(i)) matches.emplace_back(int(i), j);
  }
  return matches;
}

/// A feature of a view.
struct Place {
  std::uint32_t view = 0, feature = 0;
};

/// Pixels of `kLongestSide` between where a point appears and where it should; huge behind the camera.
double distance_in(const View& view, const Affined& camera_from_world, Vec3d point, PixelPosition shown,
                   const FeatureTracks::ViewFeatures& features) {
  const auto seen = project(view.intrinsics, camera_from_world.point(point));
  return seen ? std::hypot(seen->x - shown.x, seen->y - shown.y) * features.pixel_per_own : 1e9;
}

/// Makes points of matches. A point starts with two features that match and takes in what matches its features, as long
/// as it lies where the point is seen: a wrong match costs a sighting, it does not join two points.
class Triangulator {
 public:
  Triangulator(const Capture& capture, const std::vector<FeatureTracks::ViewFeatures>& views,
               const std::vector<ViewRays>& rays, double tolerance)
      : capture_(capture), views_(views), rays_(rays), tolerance_(tolerance) {
    for (const View& view : capture.views) camera_from_world_.push_back(view.world_from_camera.inverse());
    for (const FeatureTracks::ViewFeatures& view : views) {
      partners_.emplace_back(view.pixels.size());
      is_used_.emplace_back(view.pixels.size(), false);
    }
  }

  void add(Place a, Place b) {
    partners_of(a).push_back(b);
    partners_of(b).push_back(a);
    const double angle = std::acos(std::clamp(dot(ray_of(a).direction, ray_of(b).direction), -1.0, 1.0));
    if (angle > kLeastAngle) starts_.push_back({angle, a, b});
  }

  /// Pairs that look at their point from the most different sides know best where it is, and come first.
  [[nodiscard]] std::vector<Track> tracks() {
    std::ranges::stable_sort(starts_, std::ranges::greater{}, &Start::angle);
    std::vector<Track> tracks;
    for (const Start& start : starts_) {
      if (is_used(start.a) || is_used(start.b)) continue;
      const std::vector<Place> places = grown({start.a, start.b});
      if (places.size() < FeatureTracks::kFewestViews) continue;
      for (const Place& place : places) is_used_[place.view][place.feature] = true;
      tracks.push_back(track_of(places));
    }
    return tracks;
  }

 private:
  struct Start {
    double angle;
    Place a, b;
  };

  /// All that agree with a point of these, one per view; fewer than two where they do not agree themselves.
  [[nodiscard]] std::vector<Place> grown(std::vector<Place> places) const {
    constexpr int kMostRounds = 10;  // one may come and go for ever
    std::size_t before = 0;
    for (int round = 0; before != places.size() && round < kMostRounds; ++round) {
      before = places.size();
      const auto position = position_of(places);
      if (!position) return {};
      std::erase_if(places, [&](Place each) { return error_of(each, *position) > tolerance_; });
      if (places.size() < before) continue;  // once more without them
      for (std::size_t i = 0; i < places.size(); ++i) take_partners(places[i], *position, places);
    }
    return places;
  }
  void take_partners(Place of, Vec3d position, std::vector<Place>& places) const {
    for (const Place partner : partners_[of.view][of.feature]) {
      const bool is_new = !is_used(partner) && std::ranges::find(places, partner.view, &Place::view) == places.end();
      if (is_new && error_of(partner, position) < tolerance_) places.push_back(partner);
    }
  }

  [[nodiscard]] std::optional<Vec3d> position_of(const std::vector<Place>& places) const {
    if (places.size() < 2) return std::nullopt;
    std::vector<WorldRay> rays;
    for (const Place place : places) rays.push_back(ray_of(place));
    return nearest_point(rays, 0);
  }
  [[nodiscard]] WorldRay ray_of(Place place) const {
    return {centre_of(capture_.views[place.view]), rays_[place.view].directions[place.feature]};
  }
  [[nodiscard]] double error_of(Place place, Vec3d position) const {
    return distance_in(capture_.views[place.view], camera_from_world_[place.view], position, pixel_of(place),
                       views_[place.view]);
  }
  [[nodiscard]] Track track_of(const std::vector<Place>& places) const {
    Track track{*position_of(places), 0, {}};
    for (const Place place : places) {
      track.error += error_of(place, track.position) / double(places.size());
      track.sightings.push_back({place.view, pixel_of(place)});
    }
    std::ranges::sort(track.sightings, {}, &Track::Sighting::view);
    return track;
  }

  [[nodiscard]] PixelPosition pixel_of(Place place) const { return views_[place.view].pixels[place.feature]; }
  std::vector<Place>& partners_of(Place of) { return partners_[of.view][of.feature]; }
  [[nodiscard]] bool is_used(Place of) const { return is_used_[of.view][of.feature]; }

  const Capture& capture_;
  const std::vector<FeatureTracks::ViewFeatures>& views_;
  const std::vector<ViewRays>& rays_;
  double tolerance_;
  std::vector<Affined> camera_from_world_;
  std::vector<std::vector<std::vector<Place>>> partners_;  ///< [view][feature]
  std::vector<std::vector<bool>> is_used_;                 ///< [view][feature]
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

SparsePoint point_of(const Track& track) {
  SparsePoint point{track.position, track.error, {}};
  for (const Track::Sighting& sighting : track.sightings) point.views.push_back(sighting.view);
  return point;
}

FeatureTracks::FeatureTracks(const Capture& capture, Observer& observer) : features_(capture.views.size()) {
  in_parts(features_.size(), "features", {0, 0.5}, observer, [&](std::size_t i) {
    if (!capture.views[i].held_out) features_[i] = features_of(capture.views[i]);
  });
}

std::vector<Track> FeatureTracks::triangulated(const Capture& capture, double tolerance, Observer& observer) const {
  std::vector<ViewRays> rays;
  for (std::size_t v = 0; v < features_.size(); ++v) rays.push_back(rays_of(capture.views[v], features_[v]));
  const auto pairs = pairs_of(capture);
  std::vector<std::vector<Match>> matches(pairs.size());
  in_parts(pairs.size(), "matches", {0.5, 1}, observer, [&](std::size_t k) {
    const auto [a, b] = pairs[k];
    const Vec3d baseline = centre_of(capture.views[b]) - centre_of(capture.views[a]);
    if (features_[a].pixels.empty() || features_[b].pixels.empty() || !(length(baseline) > 0)) return;
    const double angle = tolerance * std::max(rays[a].pixel_angle, rays[b].pixel_angle);
    matches[k] = matches_of(features_[a], rays[a], features_[b], rays[b], baseline, angle);
  });
  Triangulator triangulator(capture, features_, rays, tolerance);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const auto [a, b] = pairs[k];
    for (const auto& [of_a, of_b] : matches[k]) {
      triangulator.add({std::uint32_t(a), std::uint32_t(of_a)}, {std::uint32_t(b), std::uint32_t(of_b)});
    }
  }
  return triangulator.tracks();
}

double FeatureTracks::error_of(const Track& track, const Capture& capture) const {
  double sum = 0;
  for (const Track::Sighting& sighting : track.sightings) {
    const View& view = capture.views[sighting.view];
    sum +=
        distance_in(view, view.world_from_camera.inverse(), track.position, sighting.pixel, features_[sighting.view]);
  }
  return sum / double(track.sightings.size());
}

}  // namespace cnerf::prepare
