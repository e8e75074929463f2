#include "src/prepare/exposure.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>

#include "src/base/parallel.h"
#include "src/base/statistics.h"
#include "src/capture/image_io.h"
#include "src/capture/listing.h"

namespace cnerf::prepare {
namespace fs = std::filesystem;
namespace {

constexpr int kRounds = 30;
constexpr int kHazeRounds = 300;
constexpr double kExactLight = 0.004;  ///< difference of linear light below which all sightings count fully
constexpr double kHeld = 1e-9;         ///< of a view's weight, pulling its logarithm to 0
constexpr double kExact = 0.01;        ///< difference of logarithms below which all sightings count fully
constexpr double kSettled = 1e-6;      ///< largest change of a logarithm in a round
constexpr float kDarkest = 0.004f, kLightest = 0.9f;  ///< luminance between noise and clipping

/// Mean light around pixel positions of an image: 5 x 5 pixels, so that grain averages out.
cv::Mat1f smoothed(const fs::path& file) {
  const LinearImage image = luminance_image(read_linear_image(file, Transfer::kSrgb));
  cv::Mat1f light(image.height, image.width);
  std::copy(image.values.begin(), image.values.end(), light.begin());
  cv::blur(light, light, {5, 5});
  return light;
}

}  // namespace

std::vector<double> solve_exposures(int views, const std::vector<Sighting>& sightings) {
  std::map<int, std::vector<std::size_t>> places;
  std::vector<double> logs, weights(sightings.size(), 1.0);
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    places[sightings[i].place].push_back(i);
    logs.push_back(std::log(sightings[i].light));
  }
  cv::Mat1d exposure = cv::Mat1d::zeros(views, 1);
  for (int round = 0; round < kRounds; ++round) {
    // Of each place the weighted mean of its sightings is the best light, which leaves equations between views only.
    cv::Mat1d normal = cv::Mat1d::zeros(views, views), right = cv::Mat1d::zeros(views, 1);
    for (const auto& [place, seen] : places) {
      double weight = 0, sum = 0;
      for (const std::size_t i : seen) weight += weights[i], sum += weights[i] * logs[i];
      for (const std::size_t i : seen) {
        const int view = sightings[i].view;
        normal(view, view) += weights[i];
        right(view) += weights[i] * (logs[i] - sum / weight);
        for (const std::size_t j : seen) normal(view, sightings[j].view) -= weights[i] * weights[j] / weight;
      }
    }
    for (int v = 0; v < views; ++v) normal(v, v) += kHeld * (1 + normal(v, v));  // the common factor is free
    const cv::Mat1d before = exposure.clone();
    cv::solve(normal, right, exposure, cv::DECOMP_CHOLESKY);
    for (const auto& [place, seen] : places) {
      double weight = 0, sum = 0;
      for (const std::size_t i : seen) {
        weight += weights[i];
        sum += weights[i] * (logs[i] - exposure(sightings[i].view));
      }
      for (const std::size_t i : seen) {
        const double off = logs[i] - exposure(sightings[i].view) - sum / weight;
        weights[i] = kExact / std::max(kExact, std::abs(off));
      }
    }
    if (cv::norm(exposure, before, cv::NORM_INF) < kSettled) break;
  }
  std::vector<bool> is_seen(std::size_t(views), false);
  for (const Sighting& seen : sightings) is_seen[std::size_t(seen.view)] = true;
  std::vector<double> known;
  for (int v = 0; v < views; ++v) {
    if (is_seen[std::size_t(v)]) known.push_back(exposure(v));
  }
  const double middle = known.empty() ? 0 : median(known);
  std::vector<double> out;
  for (int v = 0; v < views; ++v) out.push_back(is_seen[std::size_t(v)] ? std::exp(exposure(v) - middle) : 1);
  return out;
}

namespace {

/// Alternates between the light of places and that of views, which pull each other to a fit.
class HazeFit {
 public:
  HazeFit(int views, const std::vector<Sighting>& sightings) : sightings_(sightings), weights_(sightings.size(), 1.0) {
    for (const double exposure : solve_exposures(views, sightings)) light_.push_back({exposure, 0});
    sighted_.assign(light_.size(), 0);
    std::map<int, std::size_t> number;  // places are numbered with gaps
    for (const Sighting& seen : sightings) {
      place_.push_back(number.try_emplace(seen.place, number.size()).first->second);
      ++sighted_[std::size_t(seen.view)];
    }
    of_place_.resize(number.size());
  }

  void round() {
    light_places();
    fit_lines();
    fix_what_is_free();
    reweight();
  }
  [[nodiscard]] const std::vector<ViewLight>& light() const { return light_; }

 private:
  [[nodiscard]] bool is_fitted(std::size_t view) const { return sighted_[view] >= kSightingsForHaze; }

  /// The best light of each place for the views as they stand.
  void light_places() {
    std::vector<double> sum(of_place_.size(), 0.0), weight(of_place_.size(), 0.0);
    for (std::size_t i = 0; i < sightings_.size(); ++i) {
      const ViewLight& view = light_[std::size_t(sightings_[i].view)];
      sum[place_[i]] += weights_[i] * view.exposure * (sightings_[i].light - view.haze);
      weight[place_[i]] += weights_[i] * view.exposure * view.exposure;
    }
    for (std::size_t p = 0; p < sum.size(); ++p) of_place_[p] = sum[p] / weight[p];
  }

  /// The best line of each view through the light of its places.
  void fit_lines() {
    struct Sums {
      double w = 0, x = 0, y = 0, xx = 0, xy = 0;
    };
    std::vector<Sums> sums(light_.size());
    for (std::size_t i = 0; i < sightings_.size(); ++i) {
      Sums& s = sums[std::size_t(sightings_[i].view)];
      const double w = weights_[i], x = of_place_[place_[i]], y = sightings_[i].light;
      s.w += w, s.x += w * x, s.y += w * y, s.xx += w * x * x, s.xy += w * x * y;
    }
    for (std::size_t v = 0; v < sums.size(); ++v) {
      const Sums& s = sums[v];
      const double spread = s.w * s.xx - s.x * s.x;
      if (!is_fitted(v) || !(spread > 1e-9 * s.w * s.w)) continue;
      light_[v].exposure = std::max(1e-3, (s.w * s.xy - s.x * s.y) / spread);
      light_[v].haze = (s.y - light_[v].exposure * s.x) / s.w;
    }
  }

  /// A factor and a light common to all places: the median exposure becomes 1, the least haze 0.
  void fix_what_is_free() {
    std::vector<double> exposures, hazes;
    for (std::size_t v = 0; v < light_.size(); ++v) {
      if (!is_fitted(v)) continue;
      exposures.push_back(light_[v].exposure);
      hazes.push_back(light_[v].haze / light_[v].exposure);
    }
    if (exposures.empty()) return;
    const double factor = median(exposures), least = *std::ranges::min_element(hazes);
    for (std::size_t v = 0; v < light_.size(); ++v) {
      if (!is_fitted(v)) continue;
      light_[v].haze = std::max(0.0, light_[v].haze - light_[v].exposure * least);
      light_[v].exposure /= factor;
    }
    for (double& light : of_place_) light = factor * (light + least);
  }

  void reweight() {
    for (std::size_t i = 0; i < sightings_.size(); ++i) {
      const ViewLight& view = light_[std::size_t(sightings_[i].view)];
      const double off = sightings_[i].light - view.exposure * of_place_[place_[i]] - view.haze;
      weights_[i] = kExactLight / std::max(kExactLight, std::abs(off));
    }
  }

  const std::vector<Sighting>& sightings_;
  std::vector<double> weights_;     ///< of the sightings
  std::vector<std::size_t> place_;  ///< of the sightings, counted without gaps
  std::vector<double> of_place_;    ///< light of the places
  std::vector<ViewLight> light_;    ///< of the views
  std::vector<int> sighted_;        ///< sightings of the views
};

}  // namespace

std::vector<ViewLight> solve_exposures_and_haze(int views, const std::vector<Sighting>& sightings) {
  HazeFit fit(views, sightings);
  for (int round = 0; round < kHazeRounds; ++round) fit.round();
  return fit.light();
}

std::optional<double> estimate_exposures(std::vector<PreparedImage>& images, const fs::path& capture,
                                         const fs::path& model, bool with_haze) {
  const ImagePlaces places(images);
  std::vector<std::vector<ColmapObservation>> by_image(images.size());
  for (ColmapObservation& seen : read_colmap_observations(model)) {
    if (const auto found = places.of(seen.image)) by_image[*found].push_back(std::move(seen));
  }
  std::vector<std::vector<Sighting>> parts(images.size());
  parallel_tasks(images.size(), [&](std::size_t i) {
    if (by_image[i].empty()) return;
    const cv::Mat1f light = smoothed(capture / "images" / images[i].name);
    for (const ColmapObservation& seen : by_image[i]) {
      if (!(seen.x >= 0 && seen.y >= 0 && seen.x < light.cols && seen.y < light.rows)) continue;
      const float value = light(int(seen.y), int(seen.x));
      if (value > kDarkest && value < kLightest) parts[i].push_back({int(i), int(seen.point), double(value)});
    }
  });
  std::vector<Sighting> sightings;
  std::map<int, int> place_of;  // points are numbered with gaps
  for (const auto& part : parts) {
    for (Sighting seen : part) {
      seen.place = place_of.try_emplace(seen.place, int(place_of.size())).first->second;
      sightings.push_back(seen);
    }
  }
  if (sightings.empty()) return std::nullopt;
  const std::vector<double> exposures = solve_exposures(int(images.size()), sightings);
  double squared = 0;
  for (const double exposure : exposures) squared += std::log(exposure) * std::log(exposure) / double(exposures.size());
  const double spread = std::sqrt(squared);
  if (spread < kNotedExposure) return spread;
  for (std::size_t i = 0; i < images.size(); ++i) images[i].exposure = exposures[i];
  if (with_haze) {
    const std::vector<ViewLight> light = solve_exposures_and_haze(int(images.size()), sightings);
    for (std::size_t i = 0; i < images.size(); ++i)
      images[i].exposure = light[i].exposure, images[i].haze = light[i].haze;
  }
  return spread;
}

}  // namespace cnerf::prepare
