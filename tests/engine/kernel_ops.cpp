// The hash grid and the optimiser of its rows.

#include <algorithm>
#include <cmath>

#include "encoding/cpu/hash_grid_kernels.h"
#include "src/base/rng.h"
#include "src/base/vec3.h"
#include "src/optim/row_adam.h"
#include "tests/engine/backend_ops.h"
#include "tests/engine/gpu_kernels.h"
#include "tests/support/grouped.h"
#include "tests/support/hash_grid_reference.h"

namespace cnerf::test {
namespace {

/// A table and points along random rays through the unit cube, as a step has them.
struct GridProblem {
  std::vector<GridLevel> levels;
  std::vector<float> table;      ///< [rows, 4], exact in half precision
  std::vector<float> positions;  ///< [n, 3]
  std::vector<float> d_encoded;  ///< [n, 4 L], exact in bfloat16

  GridProblem(int n_levels, int log2_rows) {
    HashGridOptions options;
    options.levels = n_levels;
    options.log2_rows = log2_rows;
    levels = hash_grid_levels(options);
    SequentialRng rng(7, 2);
    // Multiples of 1/256 of few digits survive rounding to either 16-bit format.
    const auto coarse = [&] { return std::round(rng.uniform(-1, 1) * 128) / 128; };
    for (std::size_t i = 0; i < std::size_t(total_rows(levels)) * 4; ++i) table.push_back(coarse());
    constexpr std::size_t kPoints = 20011;
    while (positions.size() < 3 * kPoints) {
      Vec3f p = {rng.uniform(), rng.uniform(), rng.uniform()};
      const Vec3f step = normalized(Vec3f{rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)}) * (1.0f / 300);
      for (int i = 0; i < 40 && positions.size() < 3 * kPoints; ++i, p += step) {
        for (int axis = 0; axis < 3; ++axis) positions.push_back(std::clamp(p[axis], 0.0f, 1.0f));
      }
    }
    for (std::size_t i = 0; i < kPoints * 4 * levels.size(); ++i) d_encoded.push_back(coarse());
  }
  [[nodiscard]] std::size_t points() const { return positions.size() / 3; }
  [[nodiscard]] int channels() const { return 4 * int(levels.size()); }
};

std::vector<float> encode(const GridProblem& problem) {
  const AlignedVector<float> table(problem.table.begin(), problem.table.end());
  const AlignedVector<float> positions = to_groups(problem.positions, 3);
  const std::size_t groups = groups_of(problem.points());
  AlignedVector<float> encoded(groups * std::size_t(problem.channels()) * kGroup);
  hash_grid_kernels().encode(problem.levels.data(), problem.levels.size(), table.data(), positions.data(), groups,
                             encoded.data(), problem.channels());
  return from_groups(encoded, problem.channels(), problem.points());
}

std::vector<float> encode_backward(const GridProblem& problem) {
  const AlignedVector<float> positions = to_groups(problem.positions, 3);
  const AlignedVector<float> d_encoded = to_groups(problem.d_encoded, problem.channels(), 0.0f);
  AlignedVector<float> d_table(problem.table.size(), 0.0f);
  for (std::size_t l = 0; l < problem.levels.size(); ++l) {
    hash_grid_kernels().scatter_level(problem.levels[l], positions.data(), d_encoded.data(),
                                      groups_of(problem.points()), problem.channels(), 4 * int(l),
                                      d_table.data() + 4 * std::size_t(problem.levels[l].first_row));
  }
  return {d_table.begin(), d_table.end()};
}

Op hash_grid(const char* name, int levels, int log2_rows) {
  const GridProblem problem(levels, log2_rows);
  Op op;
  op.name = name;
  op.run = [problem](const Backend& backend) -> std::vector<Result> {
    const std::vector<float> encoded =
        backend.is_gpu() ? gpu_encode(problem.levels, problem.table, problem.positions) : encode(problem);
    const std::vector<float> d_table = backend.is_gpu()
                                           ? gpu_encode_backward(problem.levels, problem.positions, problem.d_encoded)
                                           : encode_backward(problem);
    return {{"features", doubles(encoded)}, {"gradient of the table", doubles(d_table)}};
  };
  op.expected = [problem]() -> std::vector<Result> {
    // Positions as floats: cells and weights are then the same but for the last bit.
    return {{"features", doubles(encode_reference(problem.levels, problem.table, problem.positions))},
            {"gradient of the table",
             doubles(encode_backward_reference(problem.levels, problem.positions, problem.d_encoded))}};
  };
  op.bounds = {{"features", 1e-6, 2e-3}, {"gradient of the table", 1e-5, 1e-5, Measure::kGradient}};
  return op;
}

/// Adam and decay on rows with and without a gradient, against the formula in double.
Op row_adam() {
  constexpr std::size_t kRows = 4099;
  constexpr float kDecay = 30;  // a step then takes 30 % of a row: no rounding hides a missing decay
  RowProblem problem;
  problem.step = AdamStep(1e-2f, 5);
  problem.decay = kDecay;
  SequentialRng rng(13, 1);
  for (std::size_t row = 0; row < kRows; ++row) {
    for (int f = 0; f < 4; ++f) {
      problem.values.push_back(rng.uniform(-1, 1));
      problem.gradient.push_back(row % 3 == 0 ? 0.0f : rng.uniform(-1, 1));
      problem.moments.push_back(rng.uniform(-1, 1));
    }
    for (int f = 0; f < 4; ++f) problem.moments.push_back(rng.uniform(0.1f, 1));
  }
  Op op;
  op.name = "RowAdam";
  op.run = [problem](const Backend& backend) -> std::vector<Result> {
    RowProblem p = problem;
    if (backend.is_gpu()) {
      gpu_update_rows(p);
    } else {
      update_rows({p.values.data(), p.gradient.data(), p.moments.data(), kRows}, p.step, p.decay);
    }
    return {{"values", doubles(p.values)}, {"moments", doubles(p.moments)}};
  };
  op.expected = [problem]() -> std::vector<Result> {
    std::vector<double> values = doubles(problem.values), moments = doubles(problem.moments);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const std::size_t row = i / 4;
      if (row % 3 == 0) continue;
      const double d = problem.gradient[i];
      double &first = moments[8 * row + i % 4], &second = moments[8 * row + 4 + i % 4];
      first = 0.9 * first + 0.1 * d;
      second = 0.99 * second + 0.01 * d * d;
      const double unbiased_first = first / (1 - std::pow(0.9, 5)), unbiased_second = second / (1 - std::pow(0.99, 5));
      values[i] = (1 - 0.01 * kDecay) * values[i] - 0.01 * unbiased_first / std::sqrt(unbiased_second);
    }
    return {{"values", values}, {"moments", moments}};
  };
  op.bounds = {{"values", 1e-5, 1e-5}, {"moments", 1e-5, 1e-5}};
  return op;
}

}  // namespace

std::vector<Op> kernel_ops() {
  return {hash_grid("HashGrid", 8, 15), hash_grid("HashGridOfFewLargeLevels", 3, 19), row_adam()};
}

}  // namespace cnerf::test
