// Patches of query-based colorization.

#include "src/train/chroma/patches.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

/// A view whose luminance grows to the right and whose left quarter is empty.
CachedView some_view(int width = 80, int height = 60) {
  CachedView view;
  view.width = width;
  view.height = height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      view.luminance.push_back(float(x) / float(width));
      view.opacity.push_back(x < width / 4 ? 0.0f : 1.0f);
    }
  }
  return view;
}

TEST(IgnoreMasked, NoPixelOfAMaskedPlaceIsPicked) {
  CachedView view = some_view();
  MonoImage image;  // twice as large as the view
  image.width = 160;
  image.height = 120;
  image.mask.assign(160 * 120, 255);
  for (int y = 0; y < 120; ++y) {
    for (int x = 81; x < 120; ++x) image.mask[std::size_t(y) * 160 + std::size_t(x)] = 0;
  }
  ignore_masked(view, image);
  const AnsweredPatch patch = {{0, 20, 0, 60}, 8, {}, std::vector<float>(2 * 8 * 8, 5.0f)};
  const PatchPixels picked = pick_pixels(view, patch, 4000, 1, 1);
  bool left = false, right = false;
  for (const std::uint32_t pixel : picked.pixels) {
    const int x = int(pixel % 80);
    EXPECT_TRUE(x < 40 || x >= 60) << x;
    left |= x == 39;
    right |= x == 60;
  }
  EXPECT_TRUE(left && right) << "its neighbours are";
  EXPECT_EQ(view.luminance, some_view().luminance) << "a colorizer sees the whole picture";
}

TEST(RandomPatch, LiesInTheViewHasTheAskedSizeAndReachesEveryBorder) {
  const std::vector<CachedView> views = {some_view()};
  std::set<int> sides;
  bool left = false, right = false, top = false, bottom = false;
  for (std::uint64_t i = 0; i < 3000; ++i) {
    const PatchPlace place = random_patch(views, 0, {0.3, 0.7}, 7, i);
    sides.insert(place.side);
    ASSERT_TRUE(place.left >= 0 && place.left + place.side <= 80 && place.top >= 0 && place.top + place.side <= 60);
    left |= place.left == 0;
    right |= place.left + place.side == 80;
    top |= place.top == 0;
    bottom |= place.top + place.side == 60;
  }
  EXPECT_TRUE(left && right && top && bottom);
  EXPECT_EQ(*sides.begin(), 18) << "0.3 of the short side";
  EXPECT_EQ(*sides.rbegin(), 42) << "0.7 of the short side";
}

TEST(RandomPatch, IsAFunctionOfSeedAndIndex) {
  const std::vector<CachedView> views = {some_view()};
  const auto text = [&](std::uint64_t seed, std::uint64_t index) {
    const PatchPlace place = random_patch(views, 0, {0.3, 0.7}, seed, index);
    return std::to_string(place.left) + "," + std::to_string(place.top) + "," + std::to_string(place.side);
  };
  EXPECT_EQ(text(1, 5), text(1, 5));
  EXPECT_NE(text(1, 5), text(1, 6));
  EXPECT_NE(text(1, 5), text(2, 5));
}

TEST(NearPatch, LiesInTheViewAndShowsMostOfTheSamePlace) {
  const std::vector<CachedView> views = {some_view()};
  std::set<int> lefts;
  for (std::uint64_t i = 0; i < 500; ++i) {
    const PatchPlace place = random_patch(views, 0, {0.7, 0.7}, 7, i), other = near_patch(views, place, 7, 1000 + i);
    ASSERT_TRUE(other.left >= 0 && other.left + other.side <= 80 && other.top >= 0 && other.top + other.side <= 60);
    EXPECT_EQ(other.view, place.view);
    EXPECT_EQ(other.index, 1000 + i);
    const auto shared = [](int a, int b, int side_a, int side_b) {
      return std::min(a + side_a, b + side_b) - std::max(a, b);
    };
    EXPECT_GE(
        shared(place.left, other.left, place.side, other.side) * shared(place.top, other.top, place.side, other.side),
        0.8 * place.side * place.side);
    lefts.insert(other.left - place.left);
  }
  EXPECT_GE(lefts.size(), 4u) << "they differ";
}

TEST(RandomPatch, OfAViewOfOneRowIsAPixel) {
  const std::vector<CachedView> views = {some_view(80, 1)};
  for (std::uint64_t i = 0; i < 100; ++i) {
    const PatchPlace place = random_patch(views, 0, {0.3, 0.7}, 7, i), other = near_patch(views, place, 7, i);
    for (const PatchPlace& one : {place, other}) {
      EXPECT_EQ(one.side, 1);
      EXPECT_EQ(one.top, 0);
      ASSERT_TRUE(one.left >= 0 && one.left < 80);
    }
  }
  const PatchPlace place = random_patch(views, 0, {0.3, 0.7}, 7, 1);
  EXPECT_EQ(render_patch(views[0], place, 4).lightness.size(), 16u);
}

TEST(RenderPatch, AveragesLightNotLightness) {
  CachedView view = some_view(8, 8);
  for (std::size_t i = 0; i < view.luminance.size(); ++i) view.luminance[i] = i % 2 == 0 ? 0.0f : 1.0f;
  const RenderedPatch patch = render_patch(view, {0, 0, 0, 8}, 4);
  ASSERT_EQ(patch.lightness.size(), 16u);
  for (const float value : patch.lightness) EXPECT_NEAR(value, lightness_from_luminance(0.5f), 1e-4);
}

TEST(CertaintyWeight, FallsByTheSquareBeyondTheColorsThatAreSure) {
  EXPECT_EQ(certainty_weight(1, 20), 1);
  EXPECT_EQ(certainty_weight(1.0f / 20, 20), 1);
  EXPECT_FLOAT_EQ(certainty_weight(1.0f / 40, 20), 0.25f);
  EXPECT_FLOAT_EQ(certainty_weight(1.0f / 313, 20), 400.0f / (313 * 313));
  EXPECT_EQ(certainty_weight(1.0f / 313, 0), 1) << "all weigh the same";
}

TEST(PickPixels, TakesTheCertaintyOfTheSamePlace) {
  const CachedView view = some_view();
  AnsweredPatch patch = {{0, 20, 0, 60}, 60, {}, std::vector<float>(2 * 60 * 60, 5.0f)};
  for (const float certainty : pick_pixels(view, patch, 100, 1, 1).certainty) EXPECT_EQ(certainty, 1);
  for (int i = 0; i < 60 * 60; ++i) patch.certainty.push_back(float(i % 60) / 60);
  const PatchPixels picked = pick_pixels(view, patch, 100, 1, 1);
  ASSERT_EQ(picked.certainty.size(), picked.pixels.size());
  for (std::size_t i = 0; i < picked.pixels.size(); ++i) {
    EXPECT_NEAR(picked.certainty[i], (float(picked.pixels[i] % 80) - 20) / 60, 1e-4);
  }
}

TEST(PickPixels, TakesVisiblePixelsOfTheSquareWithTheirOwnColours) {
  const CachedView view = some_view();
  const PatchPlace place = {0, 10, 5, 32};
  constexpr int k = 64;
  std::vector<float> ab(2 * k * k);  // a counts columns of the view, b its rows
  for (int y = 0; y < k; ++y) {
    for (int x = 0; x < k; ++x) {
      ab[std::size_t(y * k + x)] = float(place.left) + (float(x) + 0.5f) * 0.5f - 0.5f;
      ab[std::size_t(k * k + y * k + x)] = float(place.top) + (float(y) + 0.5f) * 0.5f - 0.5f;
    }
  }
  const PatchPixels picked = pick_pixels(view, {place, k, {}, ab}, 2000, 3, 4);
  ASSERT_EQ(picked.pixels.size(), picked.colors.size());
  EXPECT_GT(picked.pixels.size(), 1000u);
  for (std::size_t i = 0; i < picked.pixels.size(); ++i) {
    const int x = int(picked.pixels[i]) % view.width, y = int(picked.pixels[i]) / view.width;
    ASSERT_GE(x, 20) << "the left quarter is empty";
    ASSERT_TRUE(x < place.left + place.side && y >= place.top && y < place.top + place.side);
    EXPECT_NEAR(picked.colors[i].a, x, 1e-3);
    EXPECT_NEAR(picked.colors[i].b, y, 1e-3);
  }
}

}  // namespace
}  // namespace cnerf
