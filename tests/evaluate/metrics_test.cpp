#include "src/evaluate/metrics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "src/base/check.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

/// Vectors with the mean and exactly the covariance diag(variances), turned by an angle in the first two axes.
std::vector<float> gaussian(const std::vector<double>& mean, const std::vector<double>& variances, double angle = 0) {
  const std::size_t d = mean.size(), n = 2 * d;
  std::vector<float> vectors;
  for (std::size_t i = 0; i < d; ++i) {
    for (const double sign : {-1.0, 1.0}) {
      std::vector<double> v(d, 0.0);
      v[i] = sign * std::sqrt(variances[i] * double(n - 1) / 2);
      const double x = v[0], y = v[1];
      v[0] = std::cos(angle) * x - std::sin(angle) * y;
      v[1] = std::sin(angle) * x + std::cos(angle) * y;
      for (std::size_t k = 0; k < d; ++k) vectors.push_back(float(mean[k] + v[k]));
    }
  }
  return vectors;
}

TEST(FrechetDistance, IsThatOfTwoGaussians) {
  const std::vector<double> zero = {0, 0, 0}, mean = {1, -2, 3}, one = {4, 1, 9}, other = {1, 16, 9};
  EXPECT_NEAR(frechet_distance(gaussian(mean, one), gaussian(mean, one), 3), 0, 1e-5);
  EXPECT_NEAR(frechet_distance(gaussian(zero, one), gaussian(mean, one), 3), 1 + 4 + 9, 1e-4) << "means alone";
  // Covariances that commute: the squared distance of the deviations.
  EXPECT_NEAR(frechet_distance(gaussian(zero, one), gaussian(mean, other), 3),
              14 + (2 - 1) * (2 - 1) + (1 - 4) * (1 - 4), 1e-4);
  // Those that do not, in two dimensions: the root of a matrix has the trace √(Tr + 2 √det).
  for (const double angle : {0.3, 1.1}) {
    const double c = std::cos(angle) * std::cos(angle), s = std::sin(angle) * std::sin(angle);
    const double trace = 4 * (1 * c + 16 * s) + 1 * (1 * s + 16 * c), determinant = 4.0 * 16.0;
    const double expected = 5 + 17 - 2 * std::sqrt(trace + 2 * std::sqrt(determinant));
    EXPECT_NEAR(frechet_distance(gaussian({0, 0}, {4, 1}), gaussian({0, 0}, {1, 16}, angle), 2), expected, 1e-4);
  }
}

TEST(FrechetDistance, TakesSetsOfDifferentSizesAndMoreDimensionsThanVectors) {
  const std::vector<float> a = gaussian({0, 0, 0}, {4, 1, 9});
  std::vector<float> twice = a;
  twice.insert(twice.end(), a.begin(), a.end());
  // The same points twice: the covariance shrinks by (n - 1) 2 / (2 n - 1), n = 6.
  const double shrunk = std::sqrt(10.0 / 11);
  EXPECT_NEAR(frechet_distance(a, twice, 3), 14 * (1 - shrunk) * (1 - shrunk), 1e-5);
  EXPECT_DOUBLE_EQ(frechet_distance(a, twice, 3), frechet_distance(twice, a, 3));
  // Two vectors each of five dimensions: two lines, at right angles.
  const std::vector<float> x = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0}, y = {0, 1, 0, 0, 0, 0, -1, 0, 0, 0};
  EXPECT_NEAR(frechet_distance(x, y, 5), 2 + 2, 1e-6);
  EXPECT_NEAR(frechet_distance(x, x, 5), 0, 1e-6);
}

TEST(Psnr, ClosedForms) {
  EXPECT_NEAR(psnr_from_mse(0.01), 20, 1e-12);
  EXPECT_NEAR(psnr_from_mse(1e-3), 30, 1e-12);
  EXPECT_EQ(psnr_from_mse(0), 100);
  EXPECT_TRUE(std::isnan(psnr_from_mse(std::nan("")))) << "of no pixels";
}

TEST(Psnr, ComparesEncodedClampedValues) {
  const std::vector<float> ours = {linear_from_srgb(0.5f), 7.0f, -3.0f};
  const std::vector<float> truth = {linear_from_srgb(0.6f), 1.0f, 0.0f};
  EXPECT_NEAR(encoded_mse(ours, truth, 1), 0.01 / 3, 1e-8) << "only the first differs once clamped";
  EXPECT_NEAR(encoded_mse(ours, truth, 3), 0.01 / 3, 1e-8);
}

TEST(Psnr, InvalidPixelsDoNotCount) {
  const std::vector<float> ours = {1, 1, 1, 0, 0, 0};
  const std::vector<float> truth = {1, 1, 1, 1, 1, 1};
  const std::vector<std::uint8_t> first = {1, 0}, none = {0, 0};
  EXPECT_EQ(encoded_mse(ours, truth, 3, first), 0);
  EXPECT_NEAR(encoded_mse(ours, truth, 3), 0.5, 1e-6) << "the encoding of 1 is rounded";
  EXPECT_TRUE(std::isnan(encoded_mse(ours, truth, 3, none)));
  EXPECT_THROW((void)encoded_mse(ours, std::vector<float>{1}, 1), ContractError);
}

constexpr int kOddWidth = 23, kOddHeight = 19;

/// A deterministic texture and a disturbed copy of it.
std::pair<std::vector<float>, std::vector<float>> textures() {
  std::vector<float> a, b;
  for (int y = 0; y < kOddHeight; ++y) {
    for (int x = 0; x < kOddWidth; ++x) {
      const double value = ((x * 7 + y * 13) % 32) / 31.0;
      a.push_back(float(value));
      b.push_back(float(std::clamp(value + ((x * x + 3 * y) % 11 - 5) / 40.0, 0.0, 1.0)));
    }
  }
  return {a, b};
}

/// The value is from a direct evaluation, window by window in double, of the paper's formula in another language.
TEST(Ssim, EqualsAnIndependentEvaluation) {
  const auto [a, b] = textures();
  EXPECT_NEAR(ssim(a, b, kOddWidth, kOddHeight).value(), 0.9691785373846896, 1e-9);
  EXPECT_NEAR(ssim(b, a, kOddWidth, kOddHeight).value(), 0.9691785373846896, 1e-9) << "symmetric";
}

TEST(Ssim, EqualPicturesGiveOneAndUniformOnesTheClosedForm) {
  const auto [a, b] = textures();
  EXPECT_NEAR(ssim(a, a, kOddWidth, kOddHeight).value(), 1, 1e-12);
  const std::vector<float> dark(a.size(), 0.25f), light(a.size(), 0.75f);
  const double c1 = 1e-4;
  EXPECT_NEAR(ssim(dark, light, kOddWidth, kOddHeight).value(),
              (2 * 0.25 * 0.75 + c1) / (0.25 * 0.25 + 0.75 * 0.75 + c1), 1e-9);
}

TEST(Ssim, NeedsAWindowThatFitsAndCounts) {
  const auto [a, b] = textures();
  const std::vector<std::uint8_t> none(a.size(), 0);
  EXPECT_FALSE(ssim(a, b, kOddWidth, kOddHeight, none).has_value());
  const std::vector<float> small(10 * 40, 0.5f);
  EXPECT_FALSE(ssim(small, small, 10, 40).has_value());
}

TEST(ColorfulnessMetric, ClosedForms) {
  // Half red, half green: rg = +-255 (deviation 255), yb = 127.5 (deviation 0).
  const std::vector<std::uint8_t> halves = {255, 0, 0, 0, 255, 0};
  EXPECT_NEAR(colorfulness(halves).standard, 255 + 0.3 * 127.5, 1e-9);
  EXPECT_NEAR(colorfulness(halves).magnitude, 0.3 * std::hypot(255, 127.5), 1e-9);
  const std::vector<std::uint8_t> grey = {7, 7, 7, 200, 200, 200};
  EXPECT_EQ(colorfulness(grey).standard, 0);
  EXPECT_EQ(colorfulness(grey).magnitude, 0);
}

TEST(ColorfulnessMetric, EqualsAnIndependentEvaluation) {
  std::vector<std::uint8_t> rgb;
  for (int y = 0; y < kOddHeight; ++y) {
    for (int x = 0; x < kOddWidth; ++x) {
      for (const int value : {x * 11, y * 13, x * y}) rgb.push_back(std::uint8_t(value % 256));
    }
  }
  EXPECT_NEAR(colorfulness(rgb).standard, 125.63076180222536, 1e-6);
  EXPECT_NEAR(colorfulness(rgb).magnitude, 100.5214370614793, 1e-6);
}

TEST(ColorDiversity, ClosedForms) {
  const std::vector<float> grey = {0.1f, 0.1f, 0.1f, 0.7f, 0.7f, 0.7f}, red = {1, 0, 0}, green = {0, 1, 0},
                           blue = {0, 0, 1};
  const auto pixels = [](std::initializer_list<std::span<const float>> colors) {
    std::vector<float> rgb;
    for (const auto& color : colors) rgb.insert(rgb.end(), color.begin(), color.end());
    return rgb;
  };
  EXPECT_DOUBLE_EQ(color_diversity(grey), 1);
  EXPECT_DOUBLE_EQ(color_diversity(pixels({red, red, red})), 1) << "vivid, but one colour";
  EXPECT_NEAR(color_diversity(pixels({red, green, blue, std::span(grey).first(3)})), 4, 1e-12)
      << "as many as there are, where all are as frequent";
  // Shares 3/4 and 1/4: exp(3/4 ln 4/3 + 1/4 ln 4).
  EXPECT_NEAR(color_diversity(pixels({red, red, red, green})), std::pow(4.0 / 3, 0.75) * std::pow(4.0, 0.25), 1e-12);
  const std::vector<std::uint8_t> valid = {1, 0, 1, 0};
  EXPECT_NEAR(color_diversity(pixels({red, blue, green, blue}), valid), 2, 1e-12) << "what does not count";
  EXPECT_TRUE(std::isnan(color_diversity({})));
}

TEST(AbDistance, MatchesKnownLabValues) {
  const std::vector<float> red = {1, 0, 0}, green = {0, 1, 0}, grey = {0.3f, 0.3f, 0.3f};
  // Lab of sRGB red is (53.241, 80.094, 67.203), of green (87.738, -86.188, 83.172), given to 3 decimals.
  EXPECT_NEAR(mean_ab_distance(red, green), std::hypot(80.094 + 86.188, 67.203 - 83.172), 2e-2);
  EXPECT_NEAR(mean_ab_distance(red, grey), std::hypot(80.094, 67.203), 2e-2);
  EXPECT_NEAR(mean_ab_distance(red, {}), std::hypot(80.094, 67.203), 2e-2);
  EXPECT_EQ(mean_ab_distance(grey, {}), 0) << "grey is exactly grey";
}

TEST(Encoding, FollowsSrgb) {
  EXPECT_NEAR(encoded(std::vector<float>{0.21404f})[0], 0.5f, 1e-4);
}

}  // namespace
}  // namespace cnerf
