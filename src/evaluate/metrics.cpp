#include "src/evaluate/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/color/ab_bins.h"
#include "src/evaluate/pixel_sums.h"

namespace cnerf {
namespace {

constexpr int kWindow = 11;
constexpr double kWindowSigma = 1.5;

/// Mean and standard deviation of a stream of values.
struct Moments {
  double sum = 0, sum_of_squares = 0;
  std::size_t count = 0;

  void add(double value) {
    sum += value;
    sum_of_squares += value * value;
    ++count;
  }
  void add(const Moments& other) {
    sum += other.sum;
    sum_of_squares += other.sum_of_squares;
    count += other.count;
  }
  [[nodiscard]] double mean() const { return sum / double(count); }
  [[nodiscard]] double variance() const { return std::max(0.0, sum_of_squares / double(count) - mean() * mean()); }
};

/// How many pixels are nearest to each bin.
struct BinCounts {
  std::array<double, kAbBinCount> bins{};

  void add(const BinCounts& other) { std::ranges::transform(bins, other.bins, bins.begin(), std::plus<>()); }
};

double colorfulness_of(const Moments& rg, const Moments& yb) {
  return std::sqrt(rg.variance() + yb.variance()) + 0.3 * std::hypot(rg.mean(), yb.mean());
}

cv::Mat plane_of(std::span<const float> values, int width, int height) {
  cv::Mat plane;
  cv::Mat(height, width, CV_32F, const_cast<float*>(values.data())).convertTo(plane, CV_64F);
  return plane;
}

/// Gaussian means over the windows that lie inside: the result is smaller by `kWindow - 1` along both axes.
cv::Mat filtered(const cv::Mat& plane) {
  constexpr int kBorder = kWindow / 2;
  cv::Mat means;
  cv::GaussianBlur(plane, means, {kWindow, kWindow}, kWindowSigma);
  return means(cv::Rect(kBorder, kBorder, plane.cols - 2 * kBorder, plane.rows - 2 * kBorder));
}

/// In single precision, whose error of 1e-4 is far below what sums are told to.
Ab ab_at(std::span<const float> rgb, std::size_t pixel) {
  return ab_of_linear_rgb({rgb[3 * pixel], rgb[3 * pixel + 1], rgb[3 * pixel + 2]});
}

}  // namespace

std::optional<double> ssim(std::span<const float> ours, std::span<const float> truth, int width, int height,
                           std::span<const std::uint8_t> valid) {
  CNERF_CHECK_EQ(ours.size(), truth.size());
  CNERF_CHECK_EQ(ours.size(), std::size_t(width) * std::size_t(height));
  if (width < kWindow || height < kWindow) return std::nullopt;
  constexpr double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
  const cv::Mat a = plane_of(ours, width, height), b = plane_of(truth, width, height);
  const cv::Mat mean_a = filtered(a), mean_b = filtered(b);
  const cv::Mat aa = filtered(a.mul(a)), bb = filtered(b.mul(b)), ab = filtered(a.mul(b));

  Moments similarity;
  for (int y = 0; y < mean_a.rows; ++y) {
    for (int x = 0; x < mean_a.cols; ++x) {
      if (!counts(valid, std::size_t(y + kWindow / 2) * width + x + kWindow / 2)) continue;
      const auto ma = mean_a.at<double>(y, x), mb = mean_b.at<double>(y, x);
      const double variances = aa.at<double>(y, x) - ma * ma + bb.at<double>(y, x) - mb * mb;
      const double covariance = ab.at<double>(y, x) - ma * mb;
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

double color_diversity(std::span<const float> rgb, std::span<const std::uint8_t> valid) {
  const BinCounts pixels = summed<BinCounts>(rgb.size() / 3, [&](std::size_t pixel, BinCounts& counted) {
    if (!counts(valid, pixel)) return;
    ++counted.bins[std::size_t(nearest_bin(ab_at(rgb, pixel)))];
  });
  const double all = std::accumulate(pixels.bins.begin(), pixels.bins.end(), 0.0);
  if (all == 0) return std::numeric_limits<double>::quiet_NaN();
  double entropy = 0;
  for (const double count : pixels.bins) entropy -= count > 0 ? count / all * std::log(count / all) : 0;
  return std::exp(entropy);
}

double frechet_distance(std::span<const float> a, std::span<const float> b, std::size_t dimensions) {
  const auto centred = [&](std::span<const float> vectors, cv::Mat& mean) {
    CNERF_CHECK(vectors.size() % dimensions == 0 && vectors.size() >= 2 * dimensions, "at least two vectors");
    cv::Mat rows;
    const int n = int(vectors.size() / dimensions), d = int(dimensions);
    cv::Mat(n, d, CV_32F, const_cast<float*>(vectors.data())).convertTo(rows, CV_64F);
    cv::reduce(rows, mean, 0, cv::REDUCE_AVG);
    rows -= cv::repeat(mean, n, 1);
    return cv::Mat(rows / std::sqrt(n - 1.0));  // its rows' products sum up to the covariance
  };
  cv::Mat mean_a, mean_b, eigenvalues;
  const cv::Mat x = centred(a, mean_a), y = centred(b, mean_b);
  const cv::Mat product = x.rows < y.rows ? x * y.t() : y * x.t();
  cv::eigen(product * product.t(), eigenvalues);  // squares of its singular values
  double root = 0;
  for (int i = 0; i < eigenvalues.rows; ++i) root += std::sqrt(std::max(0.0, eigenvalues.at<double>(i)));
  const double apart = cv::norm(mean_a - mean_b);
  return apart * apart + x.dot(x) + y.dot(y) - 2 * root;
}

double mean_ab_distance(std::span<const float> ours, std::span<const float> truth,
                        std::span<const std::uint8_t> valid) {
  if (!truth.empty()) CNERF_CHECK_EQ(truth.size(), ours.size());
  const auto distance = summed<Moments>(ours.size() / 3, [&](std::size_t pixel, Moments& distances) {
    if (!counts(valid, pixel)) return;
    const Ab wanted = truth.empty() ? Ab{} : ab_at(truth, pixel), own = ab_at(ours, pixel);
    const float a = own.a - wanted.a, b = own.b - wanted.b;
    distances.add(double(std::sqrt(a * a + b * b)));
  });
  return distance.mean();
}

std::vector<float> encoded(std::span<const float> linear) {
  std::vector<float> out(linear.size());
  parallel_ranges(linear.size(), kPixelsPerTask, [&](std::size_t begin, std::size_t end) {
    std::transform(linear.begin() + begin, linear.begin() + end, out.begin() + begin, encoded_value);
  });
  return out;
}

}  // namespace cnerf
