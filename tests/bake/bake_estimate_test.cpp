#include "bake/bake_estimate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "src/base/byte_count.h"
#include "src/base/error.h"
#include "tests/bake/analytic_field.h"

namespace cnerf::test {
namespace {

const SceneFrame kFrame{{10, 20, 30}, 0.25, 1};  // world box: 4 units around (10, 20, 30)

AnalyticField ball() {
  return {kFrame, sphere_density({0.5f, 0.5f, 0.5f}, 0.25f, 400), 0.5f};
}

BakeEstimate estimate_at(int resolution) {
  BakeOptions options;
  options.resolution = resolution;
  const AnalyticField field = ball();
  return estimate_bake(field, {plan_bake(field, options)}, options);
}

TEST(BakeEstimate, VoxelsAreThoseOfTheBall) {
  for (const int resolution : {64, 256}) {  // every brick, and every fifth
    BakeOptions options;
    options.resolution = resolution;
    const double h = plan_bake(ball(), options).voxel_size;
    const double expected = 4.0 / 3 * 3.14159265 / std::pow(h, 3);  // radius 1 in world units
    EXPECT_NEAR(static_cast<double>(estimate_at(resolution).voxels), expected, 0.05 * expected) << resolution;
  }
}

TEST(BakeEstimate, MemoryGrowsWithTheVoxels) {
  const BakeEstimate small = estimate_at(64), large = estimate_at(128);
  for (const auto bytes : {&BakeEstimate::memory_bytes, &BakeEstimate::writing_bytes}) {
    EXPECT_GT(large.*bytes, 3 * (small.*bytes)) << "planes of bricks grow with the square, all bricks faster";
    EXPECT_LT(large.*bytes, 10 * (small.*bytes));
  }
  EXPECT_GT(large.disk_bytes, large.file_bytes);
}

TEST(BakeEstimate, TooLittleMemoryIsRefusedByName) {
  BakeOptions options;
  BakeEstimate estimate;
  estimate.memory_bytes = std::size_t{900} << 20;
  const std::size_t held = std::size_t{200} << 20;
  check_memory(estimate, held, options);  // no limit
  options.max_memory = "1.2G";
  check_memory(estimate, held, options);
  options.max_memory = "1G";
  try {
    check_memory(estimate, held, options);
    FAIL() << "1100 MiB do not fit into 1 GiB";
  } catch (const UsageError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("max_memory"), std::string::npos) << text;
    EXPECT_NE(text.find("1G"), std::string::npos) << text;
    EXPECT_NE(text.find("1.07 GiB"), std::string::npos) << text;
  }
  for (const char* bad : {"much", "-1G", "1T", "1G2", "0", "nan"}) {
    options.max_memory = bad;
    EXPECT_THROW(check_memory(estimate, held, options), UsageError) << bad;
  }
}

/// A plane of `side` x `side` bricks, of each of which one voxel holds something.
BakedVolume sparse_plane(int side) {
  BakedVolume volume;
  for (int j = 0; j < side; ++j) {
    for (int k = 0; k < side; ++k) volume.voxels.push_back({.i = 3, .j = 8 * j + 5, .k = 8 * k + 7, .sigma = 1});
  }
  return volume;
}

TEST(BakeEstimate, WritingIsCheckedByTheBricksThatThereAre) {
  const BakedVolume small = sparse_plane(10), large = sparse_plane(200);
  BakeOptions options;
  check_writing_memory({planes_of(large)}, 0, options);  // no limit
  options.max_memory = "100M";
  check_writing_memory({planes_of(small)}, 0, options);
  EXPECT_THROW(check_writing_memory({planes_of(small)}, std::size_t{100} << 20, options), UsageError) << "held already";
  try {
    check_writing_memory({planes_of(small), planes_of(large)}, 0, options);
    FAIL() << "40,000 leaves of three floats a voxel do not fit into 100 MiB";
  } catch (const UsageError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("max_memory: 100M"), std::string::npos) << text;
    EXPECT_NE(text.find("kept"), std::string::npos) << text;
  }
}

TEST(ByteCount, ReadsWhatPeopleWrite) {
  EXPECT_EQ(bytes_from("o", "4G"), std::size_t{4} << 30);
  EXPECT_EQ(bytes_from("o", " 1.5 M "), std::size_t{3} << 19);
  EXPECT_EQ(bytes_from("o", "64k"), 65536u);
  EXPECT_EQ(bytes_from("o", "800000"), 800000u);
  EXPECT_EQ(in_words(std::size_t{5} << 28), "1.25 GiB");
  EXPECT_EQ(in_words(std::size_t{37} << 20), "37 MiB");
}

}  // namespace
}  // namespace cnerf::test
