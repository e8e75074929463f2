#include "src/colorizer/purify.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "src/base/error.h"
#include "src/base/rng.h"

namespace cnerf {
namespace {

/// A patch with its own storage.
struct Patch {
  int side = 16;
  std::vector<float> ab, opacity;
  [[nodiscard]] ColorPatchView view() const { return {side, side, ab, opacity}; }
  [[nodiscard]] std::size_t pixels() const { return std::size_t(side * side); }
};

Patch patch_of(float a, float b, float spread = 0, std::uint64_t seed = 1) {
  Patch patch;
  patch.ab.resize(2 * patch.pixels());
  SequentialRng rng(seed, 7);
  for (std::size_t i = 0; i < patch.pixels(); ++i) {
    patch.ab[i] = a + spread * rng.normal();
    patch.ab[patch.pixels() + i] = b + spread * rng.normal();
  }
  return patch;
}

/// The first `share` of the pixels from `first`, the others from `second`.
Patch mixed(const Patch& first, const Patch& second, double share) {
  Patch result = second;
  const auto n = std::size_t(share * double(first.pixels()));
  for (std::size_t i = 0; i < n; ++i) {
    result.ab[i] = first.ab[i];
    result.ab[result.pixels() + i] = first.ab[first.pixels() + i];
  }
  return result;
}

Purifier purifier_of(const std::vector<Patch>& bases) {
  std::vector<ColorPatchView> views;
  for (const Patch& base : bases) views.push_back(base.view());
  return Purifier(PurifyOptions{}, views);
}

TEST(Purifier, APatchIsLikeItself) {
  for (const Patch& patch : {patch_of(40, 20, 8), patch_of(-30, 50, 20), patch_of(0, 0), patch_of(1, 4, 2)}) {
    EXPECT_NEAR(purifier_of({patch}).similarity(patch.view()), 1, 1e-6);
  }
}

TEST(Purifier, WhereAPixelLiesDoesNotMatter) {
  const Patch base = patch_of(30, 30, 10, 1), answer = patch_of(25, 35, 10, 2);
  Patch shuffled = answer;
  const std::size_t n = answer.pixels();
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t from = (i * 37 + 11) % n;  // 37 is odd, n a power of two: a permutation
    shuffled.ab[i] = answer.ab[from];
    shuffled.ab[n + i] = answer.ab[n + from];
  }
  const Purifier purifier = purifier_of({base});
  EXPECT_NEAR(purifier.similarity(shuffled.view()), purifier.similarity(answer.view()), 1e-6);
}

TEST(Purifier, OppositeColoursAreNotAlike) {
  EXPECT_LT(purifier_of({patch_of(50, 40, 8)}).similarity(patch_of(-50, -40, 8).view()), 0.02);
}

TEST(Purifier, TheBestBaseCounts) {
  const Patch red = patch_of(50, 30, 6), blue = patch_of(10, -50, 6), answer = patch_of(10, -50, 6, 9);
  const double with_both = purifier_of({red, blue}).similarity(answer.view());
  EXPECT_DOUBLE_EQ(with_both, purifier_of({blue}).similarity(answer.view()));
  EXPECT_GT(with_both, 0.8);
}

TEST(Purifier, HiddenPixelsDoNotCount) {
  const Patch base = patch_of(40, 40, 8);
  Patch answer = mixed(base, patch_of(-60, 10, 5), 0.5);
  answer.opacity.assign(answer.pixels(), 1.0f);
  const Purifier purifier = purifier_of({base});
  const double seen = purifier.similarity(answer.view());
  std::fill(answer.opacity.begin() + std::ptrdiff_t(answer.pixels() / 2), answer.opacity.end(), 0.0f);
  EXPECT_LT(seen, 0.8);
  EXPECT_GT(purifier.similarity(answer.view()), 0.9);
  std::fill(answer.opacity.begin(), answer.opacity.end(), 0.0f);
  EXPECT_EQ(purifier.similarity(answer.view()), 0) << "nothing visible";
}

TEST(Purifier, NeighbouringColoursAreAlikeAndSimilarityFallsWithDistance) {
  const Purifier purifier = purifier_of({patch_of(40, 40, 4)});
  double before = 1.1;
  for (const float shift : {0.0f, 5.0f, 10.0f, 20.0f, 30.0f}) {
    const double similarity = purifier.similarity(patch_of(40 + shift, 40, 4).view());
    EXPECT_LT(similarity, before) << shift;
    before = similarity;
  }
  EXPECT_GT(purifier.similarity(patch_of(45, 40, 4).view()), 0.8);
  EXPECT_LT(purifier.similarity(patch_of(70, 40, 4).view()), 0.2);
}

TEST(Purifier, GreyAroundTheColourDoesNotMakePatchesAlike) {
  const Patch grey = patch_of(0, 0, 1);
  const Patch base = mixed(patch_of(40, 40, 5), grey, 0.3), outlier = mixed(patch_of(-40, 10, 5), grey, 0.3);
  const Patch like = mixed(patch_of(40, 40, 5, 3), grey, 0.2);
  EXPECT_FALSE(purifier_of({base}).accepts(outlier.view()));
  EXPECT_TRUE(purifier_of({base}).accepts(like.view()));
}

TEST(Purifier, AGreyAnswerPassesOnlyWhereTheBasesAreMostlyGrey) {
  const Patch grey = patch_of(0, 0), colour = patch_of(40, 40, 5);
  EXPECT_TRUE(purifier_of({mixed(colour, grey, 0.2)}).accepts(grey.view()));
  EXPECT_FALSE(purifier_of({mixed(colour, grey, 0.8)}).accepts(grey.view()));
  EXPECT_TRUE(purifier_of({grey}).accepts(grey.view()));
}

TEST(Purifier, NothingJumpsWhereAnAnswerTurnsGrey) {
  const Purifier purifier = purifier_of({mixed(patch_of(40, 40, 5), patch_of(0, 0), 0.5)});
  double before = purifier.similarity(patch_of(0, 0).view());
  for (int step = 1; step <= 400; ++step) {
    const double now = purifier.similarity(patch_of(float(step) * 0.05f, 0).view());
    EXPECT_LT(std::abs(now - before), 0.25) << step * 0.05;
    before = now;
  }
}

TEST(Purifier, OutliersAmongManyAnswersAreTheOnesRejected) {
  std::vector<Patch> bases;
  for (std::uint64_t i = 0; i < 5; ++i)
    bases.push_back(mixed(patch_of(45, 30, 8, i), patch_of(-25, 35, 8, 50 + i), 0.4));
  const Purifier purifier = purifier_of(bases);
  for (std::uint64_t i = 0; i < 20; ++i) {
    const double share = 0.25 + 0.4 * double(i) / 20;
    EXPECT_TRUE(purifier.accepts(mixed(patch_of(45, 30, 8, 100 + i), patch_of(-25, 35, 8, 200 + i), share).view()));
    EXPECT_FALSE(
        purifier.accepts(mixed(patch_of(-10, -40, 8, 300 + i), patch_of(-25, 35, 8, 400 + i), share + 0.3).view()));
  }
}

TEST(Purifier, TheMostTypicalAnswerIsOfTheMajorityAndInItsMiddle) {
  // Nine answers of one kind whose hue varies, four alike of another kind, three outliers.
  std::vector<Patch> answers;
  for (int i = 0; i < 3; ++i) answers.push_back(patch_of(-40, float(20 * i - 60), 6));
  for (int i = 0; i < 4; ++i) answers.push_back(patch_of(8, 14, 6, std::uint64_t(20 + i)));
  for (int i = 0; i < 9; ++i) {
    const double hue = 0.8 + 0.1 * (i - 4);
    answers.push_back(patch_of(float(50 * std::cos(hue)), float(50 * std::sin(hue)), 6, std::uint64_t(40 + i)));
  }
  std::vector<ColorPatchView> views;
  for (const Patch& answer : answers) views.push_back(answer.view());
  const std::size_t chosen = most_typical(views);
  EXPECT_GE(chosen, 7u + 3u);
  EXPECT_LE(chosen, 7u + 5u);
  EXPECT_EQ(most_typical(std::span(views).first(1)), 0u);
  EXPECT_THROW((void)most_typical({}), ContractError);
}

TEST(Purifier, OffAcceptsEverything) {
  PurifyOptions options;
  options.enabled = false;
  const Patch base = patch_of(40, 40);
  const std::vector<ColorPatchView> bases{base.view()};
  EXPECT_TRUE(Purifier(options, bases).accepts(patch_of(-40, -40).view()));
}

TEST(Purifier, RefusesNonsense) {
  PurifyOptions options;
  EXPECT_THROW(Purifier(options, {}), std::logic_error);
  Patch cut = patch_of(1, 1);
  cut.ab.pop_back();
  const std::vector<ColorPatchView> views{cut.view()};
  EXPECT_THROW(Purifier(options, views), std::logic_error);
}

TEST(ColorHistogram, IsNormalisedAndCountsWhatIsSeen) {
  const Patch patch = mixed(patch_of(40, 40), patch_of(0, 0), 0.25);
  const ColorHistogram histogram = ab_histogram(patch.view());
  EXPECT_NEAR(std::accumulate(histogram.bins.begin(), histogram.bins.end(), 0.0), 1, 1e-5);
  EXPECT_NEAR(histogram.chromatic, 0.25, 1e-6);
  EXPECT_NEAR(histogram.visible, 1, 1e-6);
}

}  // namespace
}  // namespace cnerf
