#include "src/base/cpu_features.h"

#include <gtest/gtest.h>

#include "tests/support/isa.h"

namespace cnerf {
namespace {

TEST(CpuFeatures, TheEnvironmentLowersTheLevel) {
  for (const IsaLevel level : test::available_isas()) {
    const test::ScopedIsa isa(level);
    EXPECT_EQ(active_isa(), level) << to_string(level);
  }
}

TEST(CpuFeatures, LevelsOfOtherFamiliesLeaveTheBest) {
  const test::ScopedIsa isa(kHasNeon ? IsaLevel::kAvx2 : IsaLevel::kNeon);
  EXPECT_EQ(active_isa(), detected_isa());
}

}  // namespace
}  // namespace cnerf
