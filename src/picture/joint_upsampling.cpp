#include "src/picture/joint_upsampling.h"

#include <cmath>

#include "src/base/check.h"

namespace cnerf {

std::vector<JointUpsampler::Taps> JointUpsampler::taps_of(int samples, int pixels) {
  std::vector<Taps> all(static_cast<std::size_t>(pixels));
  for (int pixel = 0; pixel < pixels; ++pixel) {
    const double place = (pixel + 0.5) * samples / pixels - 0.5;  // among the centres of samples
    const int first = int(std::floor(place)) - kReach + 1;
    Taps& taps = all[std::size_t(pixel)];
    taps.first = first + kReach;
    for (int i = 0; i < kTaps; ++i) {
      // Smooth, and 0 at the reach: no seam where the samples of neighbouring pixels change.
      const double distance = (first + i - place) / kReach;
      const double inside = 1 - distance * distance;
      taps.weights[std::size_t(i)] = inside > 0 ? float(inside * inside * inside) : 0.0f;
    }
  }
  return all;
}

JointUpsampler::JointUpsampler(const ChromaSamples& samples, int width, int height)
    : stride_(samples.width + 2 * kReach),
      is_own_size_(samples.width == width && samples.height == height),
      columns_(taps_of(samples.width, width)),
      rows_(taps_of(samples.height, height)) {
  const std::size_t count = std::size_t(samples.width) * std::size_t(samples.height);
  CNERF_CHECK_EQ(samples.ab.size(), count);
  CNERF_CHECK_EQ(samples.lightness.size(), count);
  CNERF_CHECK_EQ(samples.weight.size(), count);
  const std::size_t padded = std::size_t(stride_) * std::size_t(samples.height + 2 * kReach);
  for (auto* plane : {&lightness_, &weight_, &a_, &b_}) plane->resize(padded);
  for (int y = 0; y < samples.height; ++y) {
    for (int x = 0; x < samples.width; ++x) {
      const std::size_t from = std::size_t(y) * std::size_t(samples.width) + std::size_t(x);
      const std::size_t to = std::size_t(y + kReach) * std::size_t(stride_) + std::size_t(x + kReach);
      lightness_[to] = samples.lightness[from];
      weight_[to] = samples.weight[from];
      a_[to] = samples.ab[from].a;
      b_[to] = samples.ab[from].b;
    }
  }
}

Ab JointUpsampler::at(int column, int row, float lightness) const {
  if (is_own_size_) {
    const std::size_t place = std::size_t(row + kReach) * std::size_t(stride_) + std::size_t(column + kReach);
    return {a_[place], b_[place]};
  }
  const Taps& across = columns_[std::size_t(column)];
  const Taps& down = rows_[std::size_t(row)];
  float total = 0, a = 0, b = 0;
  for (int y = 0; y < kTaps; ++y) {
    const std::size_t line = std::size_t(down.first + y) * std::size_t(stride_) + std::size_t(across.first);
    for (int x = 0; x < kTaps; ++x) {
      const std::size_t place = line + std::size_t(x);
      const float near = down.weights[std::size_t(y)] * across.weights[std::size_t(x)];
      const float weight = near * likeness_by_lightness(lightness_[place] - lightness) * weight_[place];
      total += weight;
      a += weight * a_[place];
      b += weight * b_[place];
    }
  }
  return total > 0 ? Ab{a / total, b / total} : Ab{};
}

}  // namespace cnerf
