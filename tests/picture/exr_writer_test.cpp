#include "src/picture/exr_writer.h"

#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "src/base/error.h"
#include "src/capture/exr_io.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {
namespace fs = std::filesystem;

TEST(ExrWriter, LargeValuesFitIntoHalfAndBrokenOnesAreRefused) {
  const test::TempDir folder;
  const std::vector<float> bright{1e6f, 0.5f, -1e6f, 2};
  write_exr(folder / "a.exr", {2, 2, {{"Y", bright, 1, true}}, {}});
  EXPECT_EQ(read_exr(folder / "a.exr").values, (std::vector<float>{65504, 0.5f, -65504, 2}));
  const std::vector<float> broken{0, std::numeric_limits<float>::quiet_NaN(), 0, 0};
  EXPECT_THROW(write_exr(folder / "b.exr", {2, 2, {{"Y", broken}}, {}}), ContractError);
  EXPECT_THROW(write_exr(folder / "b.exr", {3, 3, {{"Y", bright}}, {}}), ContractError) << "too few values";
  EXPECT_FALSE(fs::exists(folder / "b.exr"));
  std::ofstream(folder / "file") << "not a folder";
  EXPECT_THROW(write_exr(folder / "file" / "a.exr", {2, 2, {{"Y", bright}}, {}}), OutputError);
}

}  // namespace
}  // namespace cnerf
