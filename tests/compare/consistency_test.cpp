#include "src/compare/consistency.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "src/color/colorspace_math.h"

namespace cnerf::test {
namespace {
using namespace compare;

constexpr int kWidth = 80, kHeight = 60;

/// A wall at world z = 4 before cameras that look along +z, painted by `color(x, y)` of world places.
struct Wall {
  std::function<Lab<float>(double x, double y)> color;
  double wall_z = 4;

  [[nodiscard]] RenderedImage seen_from(const Intrinsics& lens, Vec3d eye) const {
    RenderedImage image;
    image.width = lens.width;
    image.height = lens.height;
    for (int y = 0; y < lens.height; ++y) {
      for (int x = 0; x < lens.width; ++x) {
        const Vec3d direction = ray_direction(lens, {x + 0.5, y + 0.5});
        const Vec3d point = eye + direction * ((wall_z - eye.z) / direction.z);
        const Vec3f rgb = linear_rgb_from_lab(color(point.x, point.y));
        image.rgb.insert(image.rgb.end(), {rgb.x, rgb.y, rgb.z});
        image.luminance.push_back(luminance_of(rgb));
        image.opacity.push_back(1);
        image.depth.push_back(float(wall_z - eye.z));
      }
    }
    return image;
  }
};

const Intrinsics kLens = {LensModel::kPinhole, kWidth, kHeight, 70, 70, kWidth / 2.0, kHeight / 2.0, {}};

Affined at(Vec3d eye) {
  return {Mat3d::identity(), eye};
}

struct Sequence {
  std::vector<RenderedImage> images;
  std::vector<SeenView> views;

  void add(RenderedImage image, Vec3d eye) {
    images.push_back(std::move(image));
    views.clear();
    eyes.push_back(eye);
    for (std::size_t i = 0; i < images.size(); ++i) views.push_back({&images[i], kLens, at(eyes[i])});
  }
  std::vector<Vec3d> eyes;
};

TEST(Consistency, ASmoothSurfaceOfOneColourIsConsistentFromEverywhere) {
  const Wall wall{[](double x, double y) { return Lab<float>{60, float(8 * x), float(6 * y)}; }};
  Sequence sequence;
  for (const double shift : {0.0, 0.13, 0.31, 0.55}) {
    sequence.add(wall.seen_from(kLens, {shift, -0.1 * shift, 0.4 * shift}), {shift, -0.1 * shift, 0.4 * shift});
  }
  const Consistency found = consistency(sequence.views, 1);
  EXPECT_GT(found.pixels, 20000u);
  EXPECT_LT(found.mean, 2e-3);  // the wall's ab is linear, so bilinear looking up is exact but for float rounding
  EXPECT_LT(found.p95, 5e-3);
}

TEST(Consistency, ATurnOfHueBetweenTwoViewsIsTheChordItMakes) {
  Sequence sequence;
  const double chroma = 20, turn = 0.5;
  const auto painted = [&](double angle) {
    return Wall{[=](double, double) {
      return Lab<float>{60, float(chroma * std::cos(angle)), float(chroma * std::sin(angle))};
    }};
  };
  sequence.add(painted(0).seen_from(kLens, {0, 0, 0}), {0, 0, 0});
  sequence.add(painted(turn).seen_from(kLens, {0.2, 0, 0}), {0.2, 0, 0});
  const Consistency found = consistency(sequence.views, 1);
  const double chord = 2 * chroma * std::sin(turn / 2);
  EXPECT_NEAR(found.mean, chord, 1e-3);
  EXPECT_NEAR(found.p95, chord, 1e-3);
  EXPECT_NEAR(found.chroma, chroma, 1e-3);
  EXPECT_NEAR(*found.relative(), 100 * chord / chroma, 1e-2);
}

TEST(Consistency, StepsCompareTheViewsThatAreSoFarApart) {
  Sequence sequence;
  for (int i = 0; i < 4; ++i) {
    const Wall wall{[=](double, double) { return Lab<float>{60, float(10 * (i % 2)), 0}; }};
    sequence.add(wall.seen_from(kLens, {0.05 * i, 0, 0}), {0.05 * i, 0, 0});
  }
  EXPECT_NEAR(consistency(sequence.views, 1).mean, 10, 1e-3);
  EXPECT_NEAR(consistency(sequence.views, 2).mean, 0, 1e-3);
  EXPECT_EQ(consistency(sequence.views, 4).pixels, 0u);
}

TEST(Consistency, WhatIsHiddenInTheOtherViewDoesNotCount) {
  const Wall grey{[](double, double) { return Lab<float>{50, 0, 0}; }};
  const Wall red{[](double, double) { return Lab<float>{50, 40, 20}; }, /*wall_z=*/2};
  const RenderedImage behind = grey.seen_from(kLens, {0, 0, 0}), before = red.seen_from(kLens, {0.1, 0, 0});
  const SeenView from{&behind, kLens, at({0, 0, 0})}, to{&before, kLens, at({0.1, 0, 0})};
  EXPECT_TRUE(carried_pixels(from, to).empty());
  // The same depths count, so it was the occlusion test.
  EXPECT_FALSE(Consistency{}.relative());
  const RenderedImage not_hidden = grey.seen_from(kLens, {0.1, 0, 0});
  EXPECT_FALSE(carried_pixels(from, {&not_hidden, kLens, at({0.1, 0, 0})}).empty());
}

TEST(Consistency, TransparentPixelsDoNotCount) {
  const Wall wall{[](double, double) { return Lab<float>{50, 0, 0}; }};
  RenderedImage image = wall.seen_from(kLens, {0, 0, 0});
  std::fill(image.opacity.begin(), image.opacity.end(), 0.5f);
  const SeenView view{&image, kLens, at({0, 0, 0})};
  EXPECT_TRUE(carried_pixels(view, view).empty());
}

}  // namespace
}  // namespace cnerf::test
