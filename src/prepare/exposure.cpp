#include "src/prepare/exposure.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>

#include "src/base/parallel.h"
#include "src/capture/byte_reader.h"
#include "src/capture/image_io.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr int kRounds = 30;
constexpr double kSettled = 1e-6;                     ///< largest change of a logarithm in a round
constexpr float kDarkest = 0.004f, kLightest = 0.9f;  ///< luminance between noise and clipping

double median(std::vector<double>& values) {
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

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
  int places = 0;
  for (const Sighting& seen : sightings) places = std::max(places, seen.place + 1);
  std::vector<std::vector<std::size_t>> of_view(static_cast<std::size_t>(views)),
      of_place(static_cast<std::size_t>(places));
  std::vector<double> logs;
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    of_view[std::size_t(sightings[i].view)].push_back(i);
    of_place[std::size_t(sightings[i].place)].push_back(i);
    logs.push_back(std::log(sightings[i].light));
  }
  std::vector<double> exposure(static_cast<std::size_t>(views)), light(static_cast<std::size_t>(places)), differences;
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t p = 0; p < of_place.size(); ++p) {
      differences.clear();
      for (const std::size_t i : of_place[p]) differences.push_back(logs[i] - exposure[std::size_t(sightings[i].view)]);
      if (!differences.empty()) light[p] = median(differences);
    }
    double change = 0;
    for (std::size_t v = 0; v < of_view.size(); ++v) {
      differences.clear();
      for (const std::size_t i : of_view[v]) differences.push_back(logs[i] - light[std::size_t(sightings[i].place)]);
      if (differences.empty()) continue;
      const double now = median(differences);
      change = std::max(change, std::abs(now - exposure[v]));
      exposure[v] = now;
    }
    if (change < kSettled) break;
  }
  differences.clear();
  for (std::size_t v = 0; v < of_view.size(); ++v) {
    if (!of_view[v].empty()) differences.push_back(exposure[v]);
  }
  const double middle = differences.empty() ? 0 : median(differences);
  for (std::size_t v = 0; v < of_view.size(); ++v)
    exposure[v] = of_view[v].empty() ? 1 : std::exp(exposure[v] - middle);
  return exposure;
}

std::vector<Observation> read_observations(const fs::path& model) {
  constexpr long long kNoPoint = -1;
  ByteReader in(model / "images.bin");
  std::vector<Observation> out;
  const auto count = in.next<std::uint64_t>("number of images");
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string field = "image " + std::to_string(i + 1) + " of " + std::to_string(count);
    in.skip(1, 4 + 7 * 8 + 4, field);  // its number, rotation, translation, camera
    const std::string name = in.next_text(field);
    const auto points = in.next<std::uint64_t>(field);
    for (std::uint64_t k = 0; k < points; ++k) {
      Observation seen;
      seen.image = name;
      seen.x = in.next<double>(field);
      seen.y = in.next<double>(field);
      seen.point = in.next<std::int64_t>(field);
      if (seen.point != kNoPoint) out.push_back(std::move(seen));
    }
  }
  return out;
}

std::optional<double> estimate_exposures(std::vector<PreparedImage>& images, const fs::path& capture,
                                         const fs::path& model) {
  if (!fs::exists(model / "images.bin")) return std::nullopt;
  std::map<std::string, int> number_of;
  for (std::size_t i = 0; i < images.size(); ++i) {
    number_of[fs::path(images[i].name).stem().string()] = int(i);
    number_of[images[i].source.stem().string()] = int(i);
  }
  std::vector<std::vector<Observation>> by_image(images.size());
  for (Observation& seen : read_observations(model)) {
    const auto found = number_of.find(fs::path(seen.image).stem().string());
    if (found != number_of.end()) by_image[std::size_t(found->second)].push_back(std::move(seen));
  }
  std::vector<std::vector<Sighting>> parts(images.size());
  parallel_tasks(images.size(), [&](std::size_t i) {
    if (by_image[i].empty()) return;
    const cv::Mat1f light = smoothed(capture / "images" / images[i].name);
    for (const Observation& seen : by_image[i]) {
      const int x = int(seen.x), y = int(seen.y);
      if (x < 0 || y < 0 || x >= light.cols || y >= light.rows) continue;
      const float value = light(y, x);
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
  const std::vector<double> exposures = solve_exposures(int(images.size()), sightings);
  double squared = 0;
  for (const double exposure : exposures) squared += std::log(exposure) * std::log(exposure) / double(exposures.size());
  const double spread = std::sqrt(squared);
  for (std::size_t i = 0; i < images.size() && spread >= kNotedExposure; ++i) images[i].exposure = exposures[i];
  return spread;
}

}  // namespace cnerf
