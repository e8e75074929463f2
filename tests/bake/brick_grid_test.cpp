#include "bake/lattice/brick_grid.h"

#include <gtest/gtest.h>

#include "src/base/error.h"

namespace cnerf::bake {
namespace {

TEST(BrickGrid, ReadsBackWhatWasWrittenAndBackgroundElsewhere) {
  BrickGrid<int> grid({-3, 5, 0}, {20, 9, 8}, -7);
  grid.set({-3, 5, 0}, 1);
  grid.set({16, 13, 7}, 2);
  EXPECT_EQ(grid.at({-3, 5, 0}), 1);
  EXPECT_EQ(grid.at({16, 13, 7}), 2);
  EXPECT_EQ(grid.at({0, 6, 3}), -7);
  EXPECT_EQ(grid.at({-4, 5, 0}), -7) << "outside";
  EXPECT_THROW(grid.set({17, 5, 0}, 3), ContractError);
}

TEST(BrickGrid, BrickNumbersAndVoxelsAgree) {
  const BrickGrid<int> grid({-3, 5, 0}, {20, 9, 17}, 0);
  EXPECT_EQ(grid.brick_counts(), (Vec3i{3, 2, 3}));
  for (std::size_t brick = 0; brick < grid.brick_count(); ++brick) {
    EXPECT_EQ(grid.brick_of(grid.brick_min(brick)), brick);
    EXPECT_EQ(grid.brick_at(grid.brick_coordinates(brick)), brick);
  }
  for (int offset = 0; offset < kBrickVoxels; ++offset) EXPECT_EQ(brick_offset(brick_local(offset)), offset);
}

TEST(BrickGrid, OnlyWrittenBricksExist) {
  BrickGrid<int> grid({0, 0, 0}, {80, 80, 80}, 0);
  grid.set({40, 40, 40}, 1);
  std::size_t existing = 0, near = 0;
  const auto touched = bricks_with_neighbours(grid);
  for (std::size_t b = 0; b < grid.brick_count(); ++b) {
    existing += grid.has_brick(b) ? 1 : 0;
    near += touched[b] ? 1 : 0;
  }
  EXPECT_EQ(existing, 1u);
  EXPECT_EQ(near, 27u);
}

}  // namespace
}  // namespace cnerf::bake
