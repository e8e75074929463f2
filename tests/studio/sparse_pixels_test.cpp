// Pixels that are foretold: exact where there is nothing to miss, traced where something begins, colours within edges.

#include "src/studio/sparse_pixels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

namespace cnerf::studio {
namespace {

constexpr int kWidth = 131, kHeight = 94;  // multiples of nothing
constexpr int kLattice = 4;
constexpr Ab kRed = {60, 40}, kBlue = {10, -50};

/// What is seen at a pixel.
using Scene = std::function<Lab<float>(int column, int row)>;

struct Drawn {
  SparsePixels pixels;
  std::size_t traced = 0, colored = 0;
  [[nodiscard]] Lab<float> at(int column, int row) const {
    const std::size_t pixel = std::size_t(row) * kWidth + std::size_t(column);
    const auto [a, b] = pixels.colors(0);
    return {pixels.lightness()[pixel], a[pixel], b[pixel]};
  }
  [[nodiscard]] double share() const { return double(traced) / (kWidth * kHeight); }
};

Drawn drawn(const Scene& scene, int lattice = kLattice) {
  Drawn result{SparsePixels(kWidth, kHeight, lattice, 1)};
  for (std::size_t pass = 0; pass < result.pixels.passes(); ++pass) {
    const std::vector<std::size_t> wanted = result.pixels.foretell(pass);
    EXPECT_TRUE(std::ranges::is_sorted(wanted));
    std::vector<float> light;
    std::vector<Ab> colors;
    for (const std::size_t pixel : wanted) {
      const Lab<float> seen = scene(int(pixel % kWidth), int(pixel / kWidth));
      light.push_back(luminance_from_lightness(seen.lightness));
      colors.push_back({seen.a, seen.b});
    }
    result.traced += wanted.size();
    result.pixels.set_light(wanted, light);
    if (!result.pixels.needs_colors(pass)) continue;
    result.colored += wanted.size();
    result.pixels.set_colors(0, wanted, colors);
  }
  result.pixels.spread_colors();
  return result;
}

/// Calls `check` with what is drawn and what is there, at every pixel.
void compare(const Drawn& result, const Scene& scene,
             const std::function<void(const Lab<float>& drawn, const Lab<float>& there)>& check) {
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      check(result.at(x, y), scene(x, y));
      if (testing::Test::HasFailure()) FAIL() << "at " << x << " " << y;
    }
  }
}

Scene disc(const Lab<float>& inside, const Lab<float>& outside) {
  return [=](int x, int y) { return std::hypot(x - 61.3, y - 43.8) < 30.2 ? inside : outside; };
}

TEST(SparsePixels, AConstantSceneIsExactAndCheap) {
  const Scene scene = [](int, int) { return Lab<float>{42, 17, -8}; };
  const Drawn result = drawn(scene);
  compare(result, scene, [](const auto& drawn, const auto& there) {
    EXPECT_FLOAT_EQ(drawn.lightness, there.lightness);
    EXPECT_EQ(drawn.a, there.a);
    EXPECT_EQ(drawn.b, there.b);
  });
  EXPECT_LT(result.share(), 0.16) << "an eighth, and the border";
}

TEST(SparsePixels, ALatticeOfOneIsEveryPixel) {
  const Scene scene = [](int x, int y) {
    return Lab<float>{float((x * 7 + y * 13) % 100), float(x % 9), float(y % 5)};
  };
  const Drawn result = drawn(scene, 1);
  EXPECT_EQ(result.traced, std::size_t(kWidth * kHeight));
  EXPECT_EQ(result.colored, result.traced);
  compare(result, scene, [](const auto& drawn, const auto& there) {
    EXPECT_NEAR(drawn.lightness, there.lightness, 1e-3);
    EXPECT_EQ(drawn.a, there.a);
  });
}

TEST(SparsePixels, SmoothShadingIsForetold) {
  const Scene scene = [](int x, int y) {
    const auto wave = float(std::sin(x / 20.0) * std::cos(y / 15.0));
    return Lab<float>{50 + 20 * wave, 10 * wave, -20 * wave};
  };
  const Drawn result = drawn(scene);
  EXPECT_LT(result.share(), 0.2);
  compare(result, scene, [](const auto& drawn, const auto& there) {
    EXPECT_NEAR(drawn.lightness, there.lightness, 0.3);
    EXPECT_NEAR(drawn.a, there.a, 0.3);
    EXPECT_NEAR(drawn.b, there.b, 0.6);
  });
}

TEST(SparsePixels, AtASilhouetteNothingBleeds) {
  for (const bool is_light_inside : {false, true}) {
    const Lab<float> light = {75, kRed.a, kRed.b}, dark = {30, kBlue.a, kBlue.b};
    const Scene scene = is_light_inside ? disc(light, dark) : disc(dark, light);
    const Drawn result = drawn(scene);
    EXPECT_LT(result.share(), 0.35);
    compare(result, scene, [](const auto& drawn, const auto& there) {
      EXPECT_NEAR(drawn.lightness, there.lightness, 0.01);
      // Of a distance of 103.
      EXPECT_LT(std::hypot(drawn.a - there.a, drawn.b - there.b), 0.3);
    });
  }
}

TEST(SparsePixels, AnEdgeOfColorAloneIsAsSharpAsASecondPixel) {
  const Lab<float> red = {50, kRed.a, kRed.b}, blue = {50, kBlue.a, kBlue.b};
  const Scene scene = [&](int x, int) { return x < 60 ? red : blue; };
  const Drawn result = drawn(scene);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (x == 59) continue;  // between two that have colours
      EXPECT_NEAR(result.at(x, y).a, scene(x, y).a, 1e-3) << x << " " << y;
    }
  }
}

TEST(SparsePixels, LinesOfTwoPixelsAreFoundWhereverTheyLie) {
  for (int place = 0; place < kLattice; ++place) {
    for (const bool is_upright : {false, true}) {
      const Scene scene = [&](int x, int y) {
        const int across = (is_upright ? x : y) - 40 - place;
        return Lab<float>{across == 0 || across == 1 ? 80.0f : 30.0f, 0, 0};
      };
      const Drawn result = drawn(scene);
      compare(result, scene,
              [](const auto& drawn, const auto& there) { EXPECT_NEAR(drawn.lightness, there.lightness, 0.01); });
    }
  }
}

TEST(SparsePixels, NoiseIsTraced) {
  const Scene scene = [](int x, int y) { return Lab<float>{float((x * 37 + y * 71 + x * y * 13) % 100), 0, 0}; };
  const Drawn result = drawn(scene);
  EXPECT_GT(result.share(), 0.95);
}

TEST(SparsePixels, BlackStaysBlackBesideLight) {
  const Scene scene = disc({90, 0, 0}, {0, 0, 0});
  compare(drawn(scene), scene, [](const auto& drawn, const auto& there) {
    EXPECT_GE(drawn.lightness, 0);
    EXPECT_NEAR(drawn.lightness, there.lightness, 0.01);
  });
}

TEST(SparsePixels, PicturesOfAPixelOrALineAreDrawnToo) {
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(1, 9), std::pair(9, 1), std::pair(3, 2)}) {
    SparsePixels pixels(width, height, kLattice, 1);
    std::size_t traced = 0;
    for (std::size_t pass = 0; pass < pixels.passes(); ++pass) {
      const std::vector<std::size_t> wanted = pixels.foretell(pass);
      pixels.set_light(wanted, std::vector<float>(wanted.size(), 0.5f));
      if (pixels.needs_colors(pass)) pixels.set_colors(0, wanted, std::vector<Ab>(wanted.size(), kRed));
      traced += wanted.size();
    }
    pixels.spread_colors();
    EXPECT_EQ(traced, std::size_t(width * height)) << "each is at the border";
    for (std::size_t p = 0; p < traced; ++p)
      EXPECT_FLOAT_EQ(pixels.colors(0)[0][p], kRed.a) << width << " x " << height;
  }
}

}  // namespace
}  // namespace cnerf::studio
