#include "src/colorizer/purify.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "src/base/check.h"

namespace cnerf {
namespace {

// ab from -130 to 130: wider than the sRGB gamut, so that the smear has room and no real colour is clamped.
constexpr int kCells = 27;
constexpr float kStep = 10.0f, kLowest = -130.0f;
constexpr double kLeastVisible = 0.01;

void check_sizes(const ColorPatchView& patch) {
  const std::size_t pixels = std::size_t(patch.height) * std::size_t(patch.width);
  CNERF_CHECK(patch.height > 0 && patch.width > 0, "empty patch");
  CNERF_CHECK_EQ(patch.ab.size(), 2 * pixels);
  if (!patch.opacity.empty()) CNERF_CHECK_EQ(patch.opacity.size(), pixels);
}

float opacity_of(const ColorPatchView& patch, std::size_t pixel) {
  return patch.opacity.empty() ? 1.0f : std::clamp(patch.opacity[pixel], 0.0f, 1.0f);
}

/// Adds `weight` to the four cells around (a, b), bilinearly.
void splat(std::vector<float>& bins, float a, float b, float weight) {
  const float x = std::clamp((a - kLowest) / kStep, 0.0f, float(kCells - 1) - 1e-3f);
  const float y = std::clamp((b - kLowest) / kStep, 0.0f, float(kCells - 1) - 1e-3f);
  const int ix = int(x), iy = int(y);
  const float fx = x - float(ix), fy = y - float(iy);
  float* cell = &bins[std::size_t(ix * kCells + iy)];
  cell[0] += weight * (1 - fx) * (1 - fy);
  cell[1] += weight * (1 - fx) * fy;
  cell[kCells] += weight * fx * (1 - fy);
  cell[kCells + 1] += weight * fx * fy;
}

constexpr int kSmearReach = 2;
using SmearKernel = std::array<float, 2 * kSmearReach + 1>;

SmearKernel smear_kernel() {
  SmearKernel kernel{};
  float sum = 0;
  for (int i = -kSmearReach; i <= kSmearReach; ++i) {
    const float distance = float(i) * kStep / kHistogramSmear;
    sum += kernel[std::size_t(i + kSmearReach)] = std::exp(-0.5f * distance * distance);
  }
  for (float& weight : kernel) weight /= sum;
  return kernel;
}

/// One pass of the separable smear, along the axis whose cells are `stride` apart; what leaves the grid is dropped.
std::vector<float> smeared(const std::vector<float>& bins, int stride) {
  static const SmearKernel kernel = smear_kernel();
  std::vector<float> result(bins.size(), 0.0f);
  for (int x = 0; x < kCells; ++x) {
    for (int y = 0; y < kCells; ++y) {
      const int along = stride == 1 ? y : x;
      float sum = 0;
      for (int i = -kSmearReach; i <= kSmearReach; ++i) {
        if (along + i < 0 || along + i >= kCells) continue;
        sum += kernel[std::size_t(i + kSmearReach)] * bins[std::size_t(x * kCells + y + i * stride)];
      }
      result[std::size_t(x * kCells + y)] = sum;
    }
  }
  return result;
}

void normalise(std::vector<float>& bins) {
  double sum = 0;
  for (float value : bins) sum += value;
  if (sum <= 0) return;
  for (float& value : bins) value = float(value / sum);
}

/// Paper, Eq. histcomparison.
double correlation(const std::vector<float>& p, const std::vector<float>& q) {
  double pq = 0, pp = 0, qq = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double x = p[i], y = q[i];
    pq += x * y;
    pp += x * x;
    qq += y * y;
  }
  return pp > 0 && qq > 0 ? pq / std::sqrt(pp * qq) : 0.0;
}

/// The same formula on the two bins "neutral" and "chromatic".
double share_correlation(double chromatic_p, double chromatic_q) {
  const double neutral_p = 1 - chromatic_p, neutral_q = 1 - chromatic_q;
  return (chromatic_p * chromatic_q + neutral_p * neutral_q) /
         (std::hypot(chromatic_p, neutral_p) * std::hypot(chromatic_q, neutral_q));
}

double similarity_of(const ColorHistogram& base, const ColorHistogram& answer) {
  const double by_color = correlation(base.bins, answer.bins);
  const double trust = std::min(1.0, answer.chromatic / Purifier::kFewChromatic);
  if (trust >= 1) return by_color;
  return trust * by_color + (1 - trust) * share_correlation(base.chromatic, answer.chromatic);
}

}  // namespace

ColorHistogram ab_histogram(const ColorPatchView& patch) {
  check_sizes(patch);
  const std::size_t pixels = std::size_t(patch.height) * std::size_t(patch.width);
  ColorHistogram result;
  std::vector<float> bins(kCells * kCells, 0.0f);
  double visible = 0, chromatic = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    const float a = patch.ab[i], b = patch.ab[pixels + i], opacity = opacity_of(patch, i);
    const float fade =
        std::clamp((std::hypot(a, b) - kNeutralChroma) / (kChromaticChroma - kNeutralChroma), 0.0f, 1.0f);
    visible += opacity;
    chromatic += opacity * fade;
    if (opacity * fade > 0) splat(bins, a, b, opacity * fade);
  }
  result.bins = smeared(smeared(bins, 1), kCells);
  normalise(result.bins);
  result.visible = visible / double(pixels);
  result.chromatic = visible > 0 ? chromatic / visible : 0;
  return result;
}

namespace {

std::vector<ColorHistogram> histograms_of(std::span<const ColorPatchView> patches) {
  std::vector<ColorHistogram> histograms;
  for (const ColorPatchView& patch : patches) histograms.push_back(ab_histogram(patch));
  return histograms;
}

}  // namespace

std::size_t most_typical(std::span<const ColorPatchView> answers) {
  CNERF_CHECK(!answers.empty(), "nothing to choose from");
  const std::vector<ColorHistogram> histograms = histograms_of(answers);
  std::vector<double> agreement(answers.size(), 0.0);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    for (std::size_t j = 0; j < answers.size(); ++j) {
      if (j != i) agreement[j] += similarity_of(histograms[i], histograms[j]);
    }
  }
  return std::size_t(std::ranges::max_element(agreement) - agreement.begin());
}

Purifier::Purifier(const PurifyOptions& options, std::span<const ColorPatchView> bases)
    : options_(options), bases_(histograms_of(bases)) {
  CNERF_CHECK(!bases.empty(), "purification needs base patches");
}

double Purifier::similarity(const ColorPatchView& answer) const {
  const ColorHistogram histogram = ab_histogram(answer);
  if (histogram.visible < kLeastVisible) return 0;
  double best = -1;
  for (const ColorHistogram& base : bases_) best = std::max(best, similarity_of(base, histogram));
  return best;
}

bool Purifier::accepts(const ColorPatchView& answer) const {
  return !options_.enabled || similarity(answer) > options_.threshold;
}

}  // namespace cnerf
