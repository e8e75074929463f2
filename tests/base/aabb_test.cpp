#include "src/base/aabb.h"

#include <gtest/gtest.h>

namespace cnerf {
namespace {

constexpr Aabbd kBox = {{-1, -2, -3}, {1, 2, 3}};

TEST(Aabb, RayFromOutsideEntersAndLeavesAtTheFaces) {
  const auto hit = intersect<double>(kBox, {-5, 0, 0}, {1, 0, 0});
  ASSERT_TRUE(hit);
  EXPECT_DOUBLE_EQ(hit->begin, 4);
  EXPECT_DOUBLE_EQ(hit->end, 6);
}

TEST(Aabb, RayFromInsideBeginsAtItsOrigin) {
  const auto hit = intersect<double>(kBox, {0, 0, 0}, {0, 0, -1});
  ASSERT_TRUE(hit);
  EXPECT_DOUBLE_EQ(hit->begin, 0);
  EXPECT_DOUBLE_EQ(hit->end, 3);
}

TEST(Aabb, BoxBehindTheRayIsMissed) {
  EXPECT_FALSE(intersect<double>(kBox, {5, 0, 0}, {1, 0, 0}));
}

TEST(Aabb, ZeroComponentsHitBetweenThePlanesAndMissBesideThem) {
  EXPECT_TRUE(intersect<double>(kBox, {0, 1.9, -9}, {0, 0, 1}));
  EXPECT_FALSE(intersect<double>(kBox, {0, 2.1, -9}, {0, 0, 1}));
  // A negative zero divides to the other infinity: it must not change the answer.
  EXPECT_TRUE(intersect<double>(kBox, {0, 1.9, -9}, {-0.0, -0.0, 1}));
  EXPECT_FALSE(intersect<double>(kBox, {0, 2.1, -9}, {-0.0, -0.0, 1}));
}

TEST(Aabb, ZeroComponentOnAPlaneIsNotNaN) {
  const auto hit = intersect<float>({{0, 0, 0}, {1, 1, 1}}, {0, 0.5f, -1}, {0, 0, 1});
  ASSERT_TRUE(hit);
  EXPECT_FLOAT_EQ(hit->begin, 1);
  EXPECT_FLOAT_EQ(hit->end, 2);
}

TEST(Aabb, ARayOfNoNumbersMisses) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(intersect(kBox, Vec3d{kNone, 0, 0}, Vec3d{1, 0, 0}));
  EXPECT_FALSE(intersect(kBox, Vec3d{0, 0, 0}, Vec3d{kNone, 1, 0}));
}

TEST(Aabb, DiagonalRayPassesACornerOrNot) {
  EXPECT_TRUE(intersect<double>(kBox, {-2, -3, 0}, {1, 1.2, 0}));
  EXPECT_FALSE(intersect<double>(kBox, {-2, -3, 0}, {1, 6, 0}));
}

TEST(Aabb, GrowsFromEmptyToHoldItsPoints) {
  Aabbd box = Aabbd::empty();
  EXPECT_FALSE(box.contains({0, 0, 0}));
  box.grow({1, 2, 3});
  EXPECT_EQ(box.size(), (Vec3d{0, 0, 0}));
  box.grow({-1, 5, 2});
  EXPECT_TRUE(box.contains({0, 3, 2.5}));
  EXPECT_FALSE(box.contains({0, 3, 3.5}));
  EXPECT_EQ(box.centre(), (Vec3d{0, 3.5, 2.5}));
}

}  // namespace
}  // namespace cnerf
