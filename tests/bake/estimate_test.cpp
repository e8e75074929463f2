#include "bake/job/estimate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "src/base/byte_count.h"
#include "src/base/error.h"
#include "tests/bake/analytic_field.h"

namespace cnerf::bake::test {
namespace {

const SceneFrame kSphereFrame{{10, 20, 30}, 0.25, 1};  // world box: 4 units around (10, 20, 30)

AnalyticField ball() {
  return {kSphereFrame, sphere_density({0.5f, 0.5f, 0.5f}, 0.25f, 400), 0.5f};
}

Estimate estimate_at(int resolution) {
  Options options;
  options.resolution = resolution;
  const AnalyticField field = ball();
  return estimate_bake(field, {plan_bake(field, options)}, options);
}

TEST(Estimate, VoxelsAreThoseOfTheBall) {
  for (const int resolution : {64, 256}) {  // every brick, and every fifth
    Options options;
    options.resolution = resolution;
    const double h = plan_bake(ball(), options).voxel_size;
    const double expected = 4.0 / 3 * 3.14159265 / std::pow(h, 3);  // radius 1 in world units
    EXPECT_NEAR(double(estimate_at(resolution).voxels), expected, 0.05 * expected) << resolution;
  }
}

TEST(Estimate, MemoryGrowsWithTheVoxels) {
  const Estimate small = estimate_at(64), large = estimate_at(128);
  const auto most = [](const Estimate& estimate) { return std::max(estimate.memory_bytes, estimate.writing_bytes); };
  EXPECT_GT(most(large), 4 * most(small)) << "planes of bricks grow with the square, all bricks faster";
  EXPECT_LT(most(large), 10 * most(small));
  EXPECT_GT(large.memory_bytes, 3 * small.memory_bytes) << "beside what threads hold at any size";
  EXPECT_GT(large.disk_bytes, large.file_bytes);
}

TEST(Estimate, TooLittleMemoryIsRefusedByName) {
  Options options;
  Estimate estimate;
  estimate.memory_bytes = std::size_t{900} << 20;
  const std::size_t held = std::size_t{200} << 20;
  check_memory(estimate, held, options);  // no limit
  options.max_memory = "1.2G";
  estimate.writing_bytes = std::size_t{10} << 30;  // at most: cameras may see little
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

/// Two planes of `side` x `side` bricks around the origin, with `voxels` voxels in each brick.
Volume plates(int side, int voxels) {
  Volume volume;
  for (const int i : {-5, 3}) {
    for (int j = -side / 2; j < side / 2; ++j) {
      for (int k = -side / 2; k < side / 2; ++k) {
        for (int v = 0; v < voxels; ++v) volume.voxels.push_back({.i = i, .j = 8 * j + 5, .k = 8 * k + v, .sigma = 1});
      }
    }
  }
  return volume;
}

TEST(Estimate, WritingIsCheckedByTheBricksThatThereAre) {
  const Volume small = plates(40, 8), large = plates(120, 1);  // 3,200 and 28,800 leaves
  const std::size_t leaf = 512 * 3 * sizeof(float);
  Options options;
  const auto fits = [&](const Volume& volume, std::size_t bytes, std::size_t held = 0) {
    options.max_memory = std::to_string(bytes);
    try {
      VolumePlanes planes = planes_of(volume);
      planes.is_sparing = true;
      check_writing_memory({planes}, held, options);
    } catch (const UsageError& error) {
      EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr("max_memory: " + options.max_memory),
                                               testing::HasSubstr("voxels are kept")));
      return false;
    }
    return true;
  };
  check_writing_memory({planes_of(large)}, 0, options);  // no limit
  for (const auto& [volume, leaves] : {std::pair{&small, 3200}, {&large, 28800}}) {
    EXPECT_FALSE(fits(*volume, leaf * leaves)) << "leaves of dilated colours come on top";
    EXPECT_TRUE(fits(*volume, 2 * leaf * leaves));
    EXPECT_FALSE(fits(*volume, 2 * leaf * leaves, leaf * leaves)) << "held already";
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
}  // namespace cnerf::bake::test
