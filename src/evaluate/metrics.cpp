#include "src/evaluate/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "src/base/check.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

constexpr double kHighestPsnr = 100;

float encoded_value(float linear) {
  return std::clamp(srgb_from_linear(linear), 0.0f, 1.0f);
}

bool counts(std::span<const std::uint8_t> valid, std::size_t pixel) {
  return valid.empty() || valid[pixel] != 0;
}

/// Mean and standard deviation of a stream of values.
struct Moments {
  double sum = 0, sum_of_squares = 0;
  std::size_t count = 0;

  void add(double value) {
    sum += value;
    sum_of_squares += value * value;
    ++count;
  }
  [[nodiscard]] double mean() const { return sum / double(count); }
  [[nodiscard]] double variance() const { return std::max(0.0, sum_of_squares / double(count) - mean() * mean()); }
};

double colorfulness_of(const Moments& rg, const Moments& yb) {
  return std::sqrt(rg.variance() + yb.variance()) + 0.3 * std::hypot(rg.mean(), yb.mean());
}

constexpr int kWindow = 11;
constexpr double kWindowSigma = 1.5;

std::array<double, kWindow> gaussian_window() {
  std::array<double, kWindow> weights{};
  double sum = 0;
  for (int i = 0; i < kWindow; ++i) {
    const double x = i - kWindow / 2;
    sum += weights[i] = std::exp(-x * x / (2 * kWindowSigma * kWindowSigma));
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

/// A picture of doubles that filtering shrinks.
struct Plane {
  int width = 0, height = 0;
  std::vector<double> values;
};

/// Gaussian filter without padding: the result is smaller by `kWindow - 1` along both axes.
Plane filtered(const Plane& in) {
  static const std::array<double, kWindow> weights = gaussian_window();
  Plane rows{in.width - kWindow + 1, in.height, {}};
  rows.values.resize(std::size_t(rows.width) * rows.height);
  for (int y = 0; y < rows.height; ++y) {
    for (int x = 0; x < rows.width; ++x) {
      double sum = 0;
      for (int i = 0; i < kWindow; ++i) sum += weights[i] * in.values[std::size_t(y) * in.width + x + i];
      rows.values[std::size_t(y) * rows.width + x] = sum;
    }
  }
  Plane out{rows.width, in.height - kWindow + 1, {}};
  out.values.resize(std::size_t(out.width) * out.height);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      double sum = 0;
      for (int i = 0; i < kWindow; ++i) sum += weights[i] * rows.values[std::size_t(y + i) * rows.width + x];
      out.values[std::size_t(y) * out.width + x] = sum;
    }
  }
  return out;
}

Plane filtered_product(std::span<const float> a, std::span<const float> b, int width, int height) {
  Plane product{width, height, {}};
  product.values.reserve(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) product.values.push_back(double(a[i]) * double(b[i]));
  return filtered(product);
}

Plane filtered_plane(std::span<const float> a, int width, int height) {
  return filtered({width, height, {a.begin(), a.end()}});
}

Lab<double> lab_at(std::span<const float> rgb, std::size_t pixel) {
  return lab_from_linear_rgb(Vec3d{rgb[3 * pixel], rgb[3 * pixel + 1], rgb[3 * pixel + 2]});
}

}  // namespace

double psnr_from_mse(double mean_squared_error) {
  if (mean_squared_error <= 0) return kHighestPsnr;
  return std::min(kHighestPsnr, -10 * std::log10(mean_squared_error));
}

double encoded_mse(std::span<const float> ours, std::span<const float> truth, int channels,
                   std::span<const std::uint8_t> valid) {
  CNERF_CHECK_EQ(ours.size(), truth.size());
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    if (!counts(valid, i / channels)) continue;
    const double difference = double(encoded_value(ours[i])) - double(encoded_value(truth[i]));
    sum += difference * difference;
    ++count;
  }
  return sum / double(count);
}

std::optional<double> ssim(std::span<const float> ours, std::span<const float> truth, int width, int height,
                           std::span<const std::uint8_t> valid) {
  CNERF_CHECK_EQ(ours.size(), truth.size());
  CNERF_CHECK_EQ(ours.size(), std::size_t(width) * std::size_t(height));
  if (width < kWindow || height < kWindow) return std::nullopt;
  constexpr double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
  const Plane mean_a = filtered_plane(ours, width, height), mean_b = filtered_plane(truth, width, height);
  const Plane aa = filtered_product(ours, ours, width, height), bb = filtered_product(truth, truth, width, height);
  const Plane ab = filtered_product(ours, truth, width, height);

  Moments similarity;
  for (int y = 0; y < mean_a.height; ++y) {
    for (int x = 0; x < mean_a.width; ++x) {
      if (!counts(valid, std::size_t(y + kWindow / 2) * width + x + kWindow / 2)) continue;
      const std::size_t i = std::size_t(y) * mean_a.width + x;
      const double ma = mean_a.values[i], mb = mean_b.values[i];
      const double variances = aa.values[i] - ma * ma + bb.values[i] - mb * mb;
      const double covariance = ab.values[i] - ma * mb;
      similarity.add((2 * ma * mb + c1) * (2 * covariance + c2) / ((ma * ma + mb * mb + c1) * (variances + c2)));
    }
  }
  if (similarity.count == 0) return std::nullopt;
  return similarity.mean();
}

Colorfulness colorfulness(std::span<const std::uint8_t> rgb, std::span<const std::uint8_t> valid) {
  Moments rg, yb, rg_magnitude, yb_magnitude;
  for (std::size_t pixel = 0; pixel < rgb.size() / 3; ++pixel) {
    if (!counts(valid, pixel)) continue;
    const double r = rgb[3 * pixel], g = rgb[3 * pixel + 1], b = rgb[3 * pixel + 2];
    const double red_green = r - g, yellow_blue = (r + g) / 2 - b;
    rg.add(red_green);
    yb.add(yellow_blue);
    rg_magnitude.add(std::abs(red_green));
    yb_magnitude.add(std::abs(yellow_blue));
  }
  return {colorfulness_of(rg, yb), colorfulness_of(rg_magnitude, yb_magnitude)};
}

double mean_ab_distance(std::span<const float> ours, std::span<const float> truth,
                        std::span<const std::uint8_t> valid) {
  if (!truth.empty()) CNERF_CHECK_EQ(truth.size(), ours.size());
  Moments distance;
  for (std::size_t pixel = 0; pixel < ours.size() / 3; ++pixel) {
    if (!counts(valid, pixel)) continue;
    const Lab<double> a = lab_at(ours, pixel);
    const Lab<double> b = truth.empty() ? Lab<double>{} : lab_at(truth, pixel);
    distance.add(std::hypot(a.a - b.a, a.b - b.b));
  }
  return distance.mean();
}

std::vector<float> encoded(std::span<const float> linear) {
  std::vector<float> out(linear.size());
  std::ranges::transform(linear, out.begin(), encoded_value);
  return out;
}

}  // namespace cnerf
