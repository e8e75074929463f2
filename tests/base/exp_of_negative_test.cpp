#include "src/base/exp_of_negative.h"

#include <gtest/gtest.h>

#include <cmath>

namespace cnerf {
namespace {

TEST(ExpOfNegative, IsWithinItsBound) {
  for (double x = 0; x >= -87; x -= 1e-3) {
    const double exact = std::exp(double(float(x)));
    ASSERT_NEAR(exp_of_negative(float(x)), exact, 3e-7 * exact) << x;
  }
}

TEST(ExpOfNegative, GoesNoFurtherDown) {
  EXPECT_EQ(exp_of_negative(-1e9f), exp_of_negative(-87.0f));
  EXPECT_GT(exp_of_negative(-1e9f), 0);
}

}  // namespace
}  // namespace cnerf
