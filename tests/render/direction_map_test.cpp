/// Equirectangular pictures: where directions lie in them, and how sums become a picture.

#include "src/render/direction_map.h"

#include <gtest/gtest.h>

#include <array>

#include "src/base/rng.h"

namespace cnerf {
namespace {

Vec3f random_direction(SequentialRng& rng) {
  while (true) {
    const Vec3f v{rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)};
    if (length(v) > 0.1f && length(v) < 1) return normalized(v);
  }
}

TEST(DirectionMap, PlacesAndDirectionsAreEachOthersInverse) {
  SequentialRng rng(3, 1);
  for (int i = 0; i < 1000; ++i) {
    const Vec3f direction = random_direction(rng);
    EXPECT_LT(length(sky_direction(sky_place(direction)) - direction), 1e-5f);
  }
}

/// As Blender's environment textures have it: +x in the middle, +y a quarter to the left, up at the top.
TEST(DirectionMap, IsLaidOutAsBlenderDoes) {
  EXPECT_NEAR(sky_place({1, 0, 0}).u, 0.5f, 1e-6f);
  EXPECT_NEAR(sky_place({0, 1, 0}).u, 0.25f, 1e-6f);
  EXPECT_NEAR(sky_place({0, -1, 0}).u, 0.75f, 1e-6f);
  EXPECT_NEAR(sky_place({0, 0, 1}).v, 1.0f, 1e-6f);
  EXPECT_NEAR(sky_place({1, 0, 0}).v, 0.5f, 1e-6f);
}

TEST(DirectionMap, GivesBackWhatWasAdded) {
  SequentialRng rng(5, 1);
  DirectionSums sums(64, 2);
  EXPECT_TRUE(sums.is_empty());
  const auto truth = [](Vec3f d) { return std::array<float, 2>{0.5f + 0.3f * d.x, d.z - 0.2f * d.y}; };
  for (int i = 0; i < 200000; ++i) {
    const Vec3f direction = random_direction(rng);
    sums.add(direction, truth(direction), rng.uniform(0.5f, 1.5f));
  }
  const DirectionMap map = sums.filled();
  for (int i = 0; i < 1000; ++i) {
    const Vec3f direction = random_direction(rng);
    if (std::abs(direction.z) > 0.97f) continue;  // rows near the poles are few samples wide
    EXPECT_NEAR(map.plane(0).along(direction), truth(direction)[0], 0.02f);
    EXPECT_NEAR(map.plane(1).along(direction), truth(direction)[1], 0.04f);
  }
}

TEST(DirectionMap, GoesOnSmoothlyWhereNothingWasAdded) {
  SequentialRng rng(7, 1);
  DirectionSums sums(64, 1);
  for (int i = 0; i < 100000; ++i) {
    const Vec3f direction = random_direction(rng);
    const float value = direction.x > 0 ? 0.8f : 0.2f;
    if (direction.z > 0.3f) sums.add(direction, std::span(&value, 1), 1);
  }
  const DirectionMap map = sums.filled();
  for (const float value : map.planes[0]) {
    EXPECT_GE(value, 0.2f - 1e-4f);
    EXPECT_LE(value, 0.8f + 1e-4f);
  }
  EXPECT_GT(map.plane(0).along(normalized(Vec3f{1, 0, -0.1f})), 0.55f);
  EXPECT_LT(map.plane(0).along(normalized(Vec3f{-1, 0, -0.1f})), 0.45f);
}

/// Both edges of the picture are the same direction, -x.
TEST(DirectionMap, HasNoSeam) {
  DirectionSums sums(32, 1);
  SequentialRng rng(9, 1);
  for (int i = 0; i < 100000; ++i) {
    const Vec3f direction = random_direction(rng);
    const float value = direction.y;
    sums.add(direction, std::span(&value, 1), 1);
  }
  const DirectionMap map = sums.filled();
  const float left = map.plane(0).along(normalized(Vec3f{-1, 1e-4f, 0}));
  const float right = map.plane(0).along(normalized(Vec3f{-1, -1e-4f, 0}));
  EXPECT_NEAR(left, right, 1e-3f);
}

}  // namespace
}  // namespace cnerf
