#include "src/evaluate/psnr.h"

#include <algorithm>
#include <cmath>

#include "src/base/check.h"
#include "src/base/statistics.h"
#include "src/color/colorspace_math.h"
#include "src/evaluate/pixel_sums.h"

namespace cnerf {
namespace {

constexpr double kHighestPsnr = 100;

struct SquaredError {
  double sum = 0;
  std::size_t count = 0;

  void add(const SquaredError& other) {
    sum += other.sum;
    count += other.count;
  }
};

}  // namespace

float encoded_value(float linear) {
  return std::clamp(srgb_from_linear(linear), 0.0f, 1.0f);
}

double psnr_from_mse(double mean_squared_error) {
  if (mean_squared_error <= 0) return kHighestPsnr;
  return std::min(-10 * std::log10(mean_squared_error), kHighestPsnr);  // in this order NaN stays NaN
}

double encoded_mse(std::span<const float> ours, std::span<const float> truth, int channels,
                   std::span<const std::uint8_t> valid) {
  CNERF_CHECK_EQ(ours.size(), truth.size());
  const auto error = summed<SquaredError>(ours.size(), [&](std::size_t i, SquaredError& errors) {
    if (!counts(valid, i / std::size_t(channels))) return;
    const double difference = double(encoded_value(ours[i])) - double(encoded_value(truth[i]));
    errors.sum += difference * difference;
    ++errors.count;
  });
  return error.sum / double(error.count);
}

double fitted_gain(std::span<const float> ours, std::span<const float> truth, std::span<const std::uint8_t> valid) {
  CNERF_CHECK_EQ(ours.size(), truth.size());
  GainFit fit;
  for (std::size_t p = 0; p < truth.size(); ++p) {
    if (counts(valid, p)) fit.add(ours[p], truth[p]);
  }
  return fit.gain();
}

}  // namespace cnerf
