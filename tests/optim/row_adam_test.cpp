#include "src/optim/row_adam.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace cnerf {
namespace {

TEST(RowAdam, MovesOnlyRowsWithGradientAndMatchesTheFormula) {
  const AdamStep step(0.1f, 1);
  const std::vector<float> gradient = {0.5f, -0.25f, 0, 1, 0, 0, 0, 0};
  std::vector<float> values(8, 1.0f), d = gradient, moments(16, 0.0f);
  update_rows({values.data(), d.data(), moments.data(), 2}, step, 0);
  // First step: first moment 0.1 g, second 0.01 g^2, both corrected: the quotient is sign(g).
  EXPECT_NEAR(values[0], 1.0f - 0.1f, 1e-6f);
  EXPECT_NEAR(values[1], 1.0f + 0.1f, 1e-6f);
  EXPECT_EQ(values[2], 1.0f);
  for (int i = 4; i < 8; ++i) EXPECT_EQ(values[i], 1.0f);
  for (const float left : d) EXPECT_EQ(left, 0.0f);

  // The same step once more, with decay: what was there shrinks where there is a gradient, and nowhere else.
  std::vector<float> shrunk(8, 1.0f);
  d = gradient;
  std::ranges::fill(moments, 0.0f);
  update_rows({shrunk.data(), d.data(), moments.data(), 2}, step, 2.5f);
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(shrunk[i], values[i] - 0.25f, 1e-6f);
  for (int i = 4; i < 8; ++i) EXPECT_EQ(shrunk[i], 1.0f);
}

}  // namespace
}  // namespace cnerf
