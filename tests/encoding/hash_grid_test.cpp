#include <gtest/gtest.h>

#include <numeric>

#include "encoding/cpu/hash_grid_kernels.h"
#include "src/base/rng.h"
#include "tests/support/finite_difference.h"
#include "tests/support/grouped.h"
#include "tests/support/hash_grid_reference.h"
#include "tests/support/isa.h"

namespace cnerf {
namespace {

using test::from_groups;
using test::to_groups;

HashGridOptions small_options() {
  return {.levels = 4, .log2_rows = 10, .coarsest_resolution = 4, .finest_resolution = 61};
}

template <typename Real>
std::vector<Real> random_values(std::size_t n, std::uint64_t seed, double low, double high) {
  const CounterRng rng(seed, 1);
  std::vector<Real> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = Real(low + (high - low) * double(rng.uniform(i)));
  return values;
}

TEST(HashGridLevels, TileTheTableWithoutOverlap) {
  const std::vector<GridLevel> levels = hash_grid_levels(small_options());
  std::uint32_t next = 0;
  for (const GridLevel& level : levels) {
    EXPECT_EQ(level.first_row, next);
    EXPECT_LE(level.rows, 1u << 10);
    next += level.rows;
  }
  EXPECT_EQ(total_rows(levels), next);
}

TEST(HashGridLevels, GrowGeometricallyBetweenTheEnds) {
  const std::vector<GridLevel> levels = hash_grid_levels(small_options());
  EXPECT_EQ(levels.front().cells, 4u);
  EXPECT_EQ(levels.back().cells, 61u);
  EXPECT_FALSE(levels[0].hashed);  // 5^3 points fit
  EXPECT_TRUE(levels[3].hashed);   // 62^3 do not
}

TEST(HashGridMath, CornerWeightsSumToOneAndRowsStayInside) {
  const std::vector<GridLevel> levels = hash_grid_levels(small_options());
  std::vector<double> positions = random_values<double>(3 * 500, 3, 0, 1);
  positions.insert(positions.end(), {0, 0, 0, 1, 1, 1, 0, 1, 0.5});
  for (std::size_t i = 0; i < positions.size(); i += 3) {
    for (const GridLevel& level : levels) {
      double sum = 0;
      for_each_corner<std::uint32_t>(level, &positions[i], [&](std::uint32_t, std::uint32_t row, double weight) {
        sum += weight;
        EXPECT_LT(row, level.rows) << "another level's, which another thread may be writing";
      });
      EXPECT_NEAR(sum, 1.0, 1e-12);
    }
  }
}

TEST(HashGridMath, InterpolatesALinearFunctionExactly) {
  HashGridOptions options = small_options();
  options.levels = 1;
  const std::vector<GridLevel> levels = hash_grid_levels(options);
  ASSERT_FALSE(levels[0].hashed);
  const int points = int(levels[0].cells) + 1;
  std::vector<double> table(4 * std::size_t(levels[0].rows), 0.0);
  for (int z = 0; z < points; ++z) {
    for (int y = 0; y < points; ++y) {
      for (int x = 0; x < points; ++x) table[4 * (x + points * (y + points * z))] = 2.0 * x - 3.0 * y + 0.5 * z;
    }
  }
  const std::vector<double> positions = random_values<double>(3 * 100, 5, 0, 1);
  const std::vector<double> encoded = encode_reference(levels, table, positions);
  const double cells = levels[0].cells;
  for (std::size_t i = 0; i < 100; ++i) {
    const double expected = cells * (2.0 * positions[3 * i] - 3.0 * positions[3 * i + 1] + 0.5 * positions[3 * i + 2]);
    EXPECT_NEAR(encoded[4 * i], expected, 1e-12);
  }
}

TEST(HashGridMath, BackwardMatchesCentralDifference) {
  const std::vector<GridLevel> levels = hash_grid_levels(small_options());
  const std::vector<double> table = random_values<double>(4 * total_rows(levels), 7, -1, 1);
  const std::vector<double> positions = random_values<double>(3 * 20, 8, 0.01, 0.99);
  const std::vector<double> d_encoded = random_values<double>(20 * 4 * levels.size(), 9, -1, 1);
  const auto loss = [&](const std::vector<double>& parameters) {
    const std::vector<double> encoded = encode_reference(levels, parameters, positions);
    return std::inner_product(encoded.begin(), encoded.end(), d_encoded.begin(), 0.0);
  };
  const std::vector<double> analytic = encode_backward_reference(levels, positions, d_encoded);
  std::vector<std::size_t> touched;
  std::vector<double> of_touched;
  for (std::size_t i = 0; i < analytic.size(); ++i) {
    if (analytic[i] != 0 && i % 3 == 0) {
      touched.push_back(i);
      of_touched.push_back(analytic[i]);
    }
  }
  ASSERT_GT(touched.size(), 100u);
  const std::vector<double> numeric = test::central_difference(table, touched, 1e-4, loss);
  EXPECT_LT(test::worst_relative_error(of_touched, numeric), 1e-6);  // the function is linear: rounding only

  // The check itself can fail: a zeroed and a sign-flipped gradient are both far off.
  EXPECT_GT(test::worst_relative_error(std::vector<double>(numeric.size(), 0.0), numeric), 0.5);
  std::vector<double> flipped = of_touched;
  for (double& value : flipped) value = -value;
  EXPECT_GT(test::worst_relative_error(flipped, numeric), 0.5);
}

TEST(HashGridMath, PositionGradientMatchesCentralDifference) {
  const std::vector<GridLevel> levels = hash_grid_levels(small_options());
  const std::vector<double> table = random_values<double>(4 * total_rows(levels), 7, -1, 1);
  const std::vector<double> positions = random_values<double>(3 * 20, 8, 0.01, 0.99);
  const std::vector<double> d_encoded = random_values<double>(20 * 4 * levels.size(), 9, -1, 1);
  const auto loss = [&](const std::vector<double>& places) {
    const std::vector<double> encoded = encode_reference(levels, table, places);
    return std::inner_product(encoded.begin(), encoded.end(), d_encoded.begin(), 0.0);
  };
  std::vector<std::size_t> all(positions.size());
  std::iota(all.begin(), all.end(), std::size_t(0));
  const std::vector<double> numeric = test::central_difference(positions, all, 1e-7, loss);
  const std::vector<double> analytic = position_gradient_reference(levels, levels.size(), table, positions, d_encoded);
  EXPECT_LT(test::worst_relative_error(analytic, numeric), 1e-5);  // linear along an axis: rounding only
  const std::vector<double> of_coarse = position_gradient_reference(levels, 1, table, positions, d_encoded);
  EXPECT_GT(test::worst_relative_error(of_coarse, numeric), 0.5);
}

class HashGridBackends : public testing::TestWithParam<std::tuple<IsaLevel, std::size_t>> {};

TEST_P(HashGridBackends, EqualReference) {
  const auto [isa, n] = GetParam();
  const test::ScopedIsa scope(isa);
  const std::vector<GridLevel> levels = hash_grid_levels(small_options());
  const int channels = 4 * int(levels.size());
  const std::vector<float> table = random_values<float>(4 * total_rows(levels), 11, -1, 1);
  const AlignedVector<float> aligned_table(table.begin(), table.end());
  std::vector<float> positions = random_values<float>(3 * n, 12, 0, 1);
  for (std::size_t i = 0; i + 6 < positions.size(); i += 9) positions[i] = positions[i + 3];  // some share cells

  AlignedVector<float> encoded(groups_of(n) * channels * kGroup);
  const AlignedVector<float> grouped = to_groups(positions, 3);
  hash_grid_kernels().encode(levels.data(), levels.size(), aligned_table.data(), grouped.data(), groups_of(n),
                             encoded.data(), channels);
  const std::vector<float> expected = encode_reference(levels, table, positions);
  // Sums of 8 products: a few roundings of values below 1.
  const std::vector<float> got = from_groups(encoded, channels, n);
  for (std::size_t i = 0; i < expected.size(); ++i) ASSERT_NEAR(got[i], expected[i], 2e-6f) << i;

  const std::vector<float> d_encoded = random_values<float>(n * channels, 13, -1, 1);
  const AlignedVector<float> d_grouped = to_groups(d_encoded, channels, 0.0f);
  for (const std::size_t counted : {std::size_t(2), levels.size()}) {
    AlignedVector<float> d_positions(groups_of(n) * 3 * kGroup, -1.0f);
    hash_grid_kernels().position_gradient(levels.data(), counted, aligned_table.data(), grouped.data(),
                                          d_grouped.data(), groups_of(n), channels, d_positions.data());
    const std::vector<float> d_expected = position_gradient_reference(levels, counted, table, positions, d_encoded);
    // Sums over levels of products with up to 61 cells.
    const std::vector<float> d_got = from_groups(d_positions, 3, n);
    for (std::size_t i = 0; i < d_expected.size(); ++i) ASSERT_NEAR(d_got[i], d_expected[i], 3e-4f) << i;
  }
  AlignedVector<float> d_table(table.size(), 0.0f);
  for (std::size_t l = 0; l < levels.size(); ++l) {
    hash_grid_kernels().scatter_level(levels[l], grouped.data(), d_grouped.data(), groups_of(n), channels, 4 * int(l),
                                      d_table.data() + 4 * std::size_t(levels[l].first_row));
  }
  const std::vector<double> exact =
      encode_backward_reference(levels, std::vector<double>(positions.begin(), positions.end()),
                                std::vector<double>(d_encoded.begin(), d_encoded.end()));
  if (n == 0) return;
  // Float sums of up to thousands of terms in a row of a coarse level, against double: measured 3e-7.
  EXPECT_LT(test::relative_distance(std::vector<float>(d_table.begin(), d_table.end()), exact), 2e-6);
}

INSTANTIATE_TEST_SUITE_P(All, HashGridBackends,
                         testing::Combine(testing::ValuesIn(test::available_isas()),
                                          testing::Values(0, 1, 15, 16, 17, 4099)),
                         [](const auto& param_info) {
                           return to_string(std::get<0>(param_info.param)) + "_" +
                                  std::to_string(std::get<1>(param_info.param));
                         });

}  // namespace
}  // namespace cnerf
