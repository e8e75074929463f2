#include "src/colorizer/purify.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "src/base/check.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

// ab from -130 to 130: wider than the sRGB gamut, so that the smear has room and no real colour is clamped.
constexpr int kCells = 27;
constexpr float kStep = 10.0f, kLowest = -130.0f;
constexpr int kRgbCells = 8;
constexpr double kLeastVisible = 0.01;

void check_sizes(const ColorPatchView& patch, bool needs_lightness) {
  const std::size_t pixels = std::size_t(patch.height) * std::size_t(patch.width);
  CNERF_CHECK(patch.height > 0 && patch.width > 0, "empty patch");
  CNERF_CHECK_EQ(patch.ab.size(), 2 * pixels);
  if (!patch.opacity.empty()) CNERF_CHECK_EQ(patch.opacity.size(), pixels);
  if (needs_lightness || !patch.lightness.empty()) CNERF_CHECK_EQ(patch.lightness.size(), pixels);
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

/// Paper, Eq. histcomparison; `centre` subtracts the means first (Pearson).
double correlation(const std::vector<float>& p, const std::vector<float>& q, bool centre) {
  const double mean = centre ? 1.0 / double(p.size()) : 0.0;  // of normalised histograms
  double pq = 0, pp = 0, qq = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double x = p[i] - mean, y = q[i] - mean;
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

double ab_similarity(const ColorHistogram& base, const ColorHistogram& answer) {
  const double by_color = correlation(base.bins, answer.bins, false);
  const double trust = std::min(1.0, answer.chromatic / Purifier::kFewChromatic);
  if (trust >= 1) return by_color;
  return trust * by_color + (1 - trust) * share_correlation(base.chromatic, answer.chromatic);
}

}  // namespace

ColorHistogram ab_histogram(const ColorPatchView& patch) {
  check_sizes(patch, false);
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

ColorHistogram rgb_histogram(const ColorPatchView& patch) {
  check_sizes(patch, true);
  const std::size_t pixels = std::size_t(patch.height) * std::size_t(patch.width);
  ColorHistogram result;
  result.bins.assign(kRgbCells * kRgbCells * kRgbCells, 0.0f);
  result.chromatic = 1;
  double visible = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    const Vec3<float> rgb =
        gamut_mapped_linear_rgb_from_lab(Lab<float>{patch.lightness[i], patch.ab[i], patch.ab[pixels + i]});
    std::size_t cell = 0;
    for (int c = 0; c < 3; ++c) {
      const int level = std::clamp(int(srgb_from_linear(rgb[c]) * kRgbCells), 0, kRgbCells - 1);
      cell = cell * kRgbCells + std::size_t(level);
    }
    const float opacity = opacity_of(patch, i);
    result.bins[cell] += opacity;
    visible += opacity;
  }
  normalise(result.bins);
  result.visible = visible / double(pixels);
  return result;
}

namespace {

std::vector<ColorHistogram> histograms_of(const PurifyOptions& options, std::span<const ColorPatchView> patches) {
  if (options.histogram != "ab" && options.histogram != "rgb") {
    throw UsageError("purify.histogram: expected \"ab\" or \"rgb\", got \"" + options.histogram + "\"");
  }
  std::vector<ColorHistogram> histograms;
  for (const ColorPatchView& patch : patches) {
    histograms.push_back(options.histogram == "rgb" ? rgb_histogram(patch) : ab_histogram(patch));
  }
  return histograms;
}

double similarity_of(const PurifyOptions& options, const ColorHistogram& base, const ColorHistogram& answer) {
  return options.histogram == "rgb" ? correlation(base.bins, answer.bins, true) : ab_similarity(base, answer);
}

}  // namespace

std::size_t most_typical(const PurifyOptions& options, std::span<const ColorPatchView> answers) {
  CNERF_CHECK(!answers.empty(), "nothing to choose from");
  const std::vector<ColorHistogram> histograms = histograms_of(options, answers);
  std::vector<double> agreement(answers.size(), 0.0);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    for (std::size_t j = 0; j < answers.size(); ++j) {
      if (j != i) agreement[j] += similarity_of(options, histograms[i], histograms[j]);
    }
  }
  return std::size_t(std::ranges::max_element(agreement) - agreement.begin());
}

Purifier::Purifier(const PurifyOptions& options, std::span<const ColorPatchView> bases)
    : options_(options), bases_(histograms_of(options, bases)) {
  CNERF_CHECK(!bases.empty(), "purification needs base patches");
}

double Purifier::similarity(const ColorPatchView& answer) const {
  const ColorHistogram histogram = histograms_of(options_, {&answer, 1}).front();
  if (histogram.visible < kLeastVisible) return 0;
  double best = -1;
  for (const ColorHistogram& base : bases_) best = std::max(best, similarity_of(options_, base, histogram));
  return best;
}

bool Purifier::accepts(const ColorPatchView& answer) const {
  return !options_.enabled || similarity(answer) > options_.threshold;
}

}  // namespace cnerf
