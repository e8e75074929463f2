// What every answer is held to: its shape and values, and how it becomes one colour per pixel.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/color/ab_bins.h"
#include "src/colorizer/colorizer.h"

namespace cnerf {
namespace {

std::string size_text(int batch, int height, int width) {
  return std::to_string(batch) + " patches of " + std::to_string(width) + "x" + std::to_string(height);
}

/// No colour of a screen is beyond +-110 in a or b, and files of Lab end at 128; networks overshoot a little.
constexpr float kLargestAb = 160;
constexpr float kLargestLogit = 1e6f;
constexpr float kLeastCertainty = 1e-3f;  // 313 equally likely colours have 0.0032

/// One of the kinds of values that an answer may hold.
struct Values {
  const char* what;
  const std::vector<float>& values;
  int channels;
  float least, largest;
};

void check_values(const std::string& colorizer, const Values& given, const ChromaBatch& answer) {
  const auto& [what, values, channels, from, to] = given;
  const float least = from, largest = to;  // what a lambda holds has to be a variable
  const std::size_t expected =
      std::size_t(answer.batch) * std::size_t(channels) * std::size_t(answer.height) * std::size_t(answer.width);
  if (values.size() != expected) {
    throw ColorizerError(colorizer + ": expected " + std::to_string(expected) + " values of " + what + ", got " +
                         std::to_string(values.size()));
  }
  const auto bad = std::ranges::find_if_not(values, [&](float v) { return v >= least && v <= largest; });  // nor NaN
  if (bad != values.end()) {
    throw ColorizerError(colorizer + ": " + what + " value " + std::to_string(bad - values.begin()) + ": expected a " +
                         "number from " + fmt::format("{:g} to {:g}", least, largest) + ", got " +
                         std::to_string(*bad));
  }
}

}  // namespace

void check_answer(const std::string& colorizer, const LightnessBatch& question, const ChromaBatch& answer) {
  if (answer.batch != question.batch || answer.height != question.height || answer.width != question.width) {
    throw ColorizerError(colorizer + ": asked about " + size_text(question.batch, question.height, question.width) +
                         ", answered " + size_text(answer.batch, answer.height, answer.width));
  }
  if (answer.ab.empty() == answer.logits.empty() && !question.lightness.empty()) {
    throw ColorizerError(colorizer + ": expected either ab or a distribution over " + std::to_string(kAbBinCount) +
                         " bins, got " + (answer.ab.empty() ? "neither" : "both"));
  }
  if (!answer.certainty.empty()) {
    check_values(colorizer, {"certainty", answer.certainty, 1, kLeastCertainty, 1}, answer);
  }
  if (answer.has_distribution()) {
    check_values(colorizer, {"logits", answer.logits, kAbBinCount, -kLargestLogit, kLargestLogit}, answer);
  } else {
    check_values(colorizer, {"ab", answer.ab, 2, -kLargestAb, kLargestAb}, answer);
  }
}

std::vector<float> ab_of(const ChromaBatch& answer, int index) {
  CNERF_CHECK(index >= 0 && index < answer.batch, "entry " + std::to_string(index));
  const std::size_t pixels = std::size_t(answer.height) * std::size_t(answer.width);
  if (!answer.has_distribution()) {
    const float* first = answer.ab.data() + std::size_t(index) * 2 * pixels;
    return {first, first + 2 * pixels};
  }
  const float* logits = answer.logits.data() + std::size_t(index) * kAbBinCount * pixels;
  std::vector<float> ab(2 * pixels);
  std::array<float, kAbBinCount> of_pixel{};
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t bin = 0; bin < kAbBinCount; ++bin) of_pixel[bin] = logits[bin * pixels + i];
    const Ab color = decode_annealed_mean(of_pixel, kAnswerTemperature);
    ab[i] = color.a;
    ab[pixels + i] = color.b;
  }
  return ab;
}

std::vector<float> certainty_of(const ChromaBatch& answer, int index) {
  CNERF_CHECK(index >= 0 && index < answer.batch, "entry " + std::to_string(index));
  const std::size_t pixels = std::size_t(answer.height) * std::size_t(answer.width),
                    first = std::size_t(index) * pixels;
  if (!answer.certainty.empty()) {
    const auto begin = answer.certainty.begin() + std::ptrdiff_t(first);
    return {begin, begin + std::ptrdiff_t(pixels)};
  }
  if (!answer.has_distribution()) return {};
  const float* logits = answer.logits.data() + first * kAbBinCount;
  std::vector<float> certainty(pixels);
  std::array<float, kAbBinCount> of_pixel{};
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t bin = 0; bin < kAbBinCount; ++bin) of_pixel[bin] = logits[bin * pixels + i];
    certainty[i] = inverse_perplexity(of_pixel);
  }
  return certainty;
}

}  // namespace cnerf
