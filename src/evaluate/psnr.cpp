#include "src/evaluate/psnr.h"

#include <algorithm>
#include <cmath>

#include "src/base/check.h"
#include "src/base/statistics.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

constexpr double kHighestPsnr = 100;

}  // namespace

float encoded_value(float linear) {
  return std::clamp(srgb_from_linear(linear), 0.0f, 1.0f);
}

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
    if (!valid.empty() && valid[i / std::size_t(channels)] == 0) continue;
    const double difference = double(encoded_value(ours[i])) - double(encoded_value(truth[i]));
    sum += difference * difference;
    ++count;
  }
  return sum / double(count);
}

double fitted_gain(std::span<const float> ours, std::span<const float> truth, std::span<const std::uint8_t> valid) {
  CNERF_CHECK_EQ(ours.size(), truth.size());
  GainFit fit;
  for (std::size_t p = 0; p < truth.size(); ++p) {
    if (valid.empty() || valid[p] != 0) fit.add(ours[p], truth[p]);
  }
  return fit.gain();
}

}  // namespace cnerf
