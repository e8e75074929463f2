// Runs the operations of backend_ops.h on the instruction sets of this processor, and on the GPU where there is one.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <utility>

#include "tests/engine/backend_ops.h"

namespace cnerf::test {
namespace {

std::vector<Op> all_ops(bool for_gpu) {
  std::vector<Op> all;
  for (auto make : {kernel_ops, luminance_ops, color_ops}) {
    for (Op& op : make()) {
      if (for_gpu || !op.is_gpu_only) all.push_back(std::move(op));
    }
  }
  return all;
}

double distance(Measure measure, const std::vector<double>& found, const std::vector<double>& expected) {
  if (measure != Measure::kPercentile99) return relative_distance(found, expected);
  std::vector<double> differences;
  for (std::size_t i = 0; i < found.size(); ++i) differences.push_back(std::abs(found[i] - expected[i]));
  const auto rank = differences.begin() + std::ptrdiff_t(differences.size() * 99 / 100);
  std::nth_element(differences.begin(), rank, differences.end());
  return *rank;
}

std::vector<Result> results_on(const Op& op, const Backend& backend) {
  if (backend.is_gpu()) return op.run(backend);
  const ScopedIsa scope(*backend.isa);
  return op.run(backend);
}

/// Computed once for all back ends of a process.
const std::vector<Result>& expected_of(const Op& op) {
  static std::map<std::string, std::vector<Result>> known;
  const auto [entry, is_new] = known.try_emplace(op.name);
  const ScopedIsa floats(best_float_isa());
  if (is_new) entry->second = op.expected ? op.expected() : results_on(op, reference_backend());
  return entry->second;
}

void compare(const Op& op, const Backend& backend) {
  const std::vector<Result>& expected = expected_of(op);
  const std::vector<Result> found = results_on(op, backend);
  ASSERT_EQ(found.size(), expected.size());
  ASSERT_EQ(found.size(), op.bounds.size()) << "every result has a bound";
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Bound& bound = op.bounds[i];
    ASSERT_EQ(found[i].name, bound.result);
    ASSERT_EQ(found[i].values.size(), expected[i].values.size()) << bound.result;
    EXPECT_LE(distance(bound.measure, found[i].values, expected[i].values),
              backend.is_gpu() ? bound.gpu : bound.processor)
        << bound.result;
    if (bound.measure != Measure::kGradient) continue;
    std::vector<double> flipped = found[i].values;
    for (double& value : flipped) value = -value;
    EXPECT_GT(relative_distance(flipped, expected[i].values), 1.0) << bound.result << ": the comparison sees nothing";
  }
}

std::string name_of(const testing::TestParamInfo<Op>& op) {
  return op.param.name;
}

class ProcessorOps : public testing::TestWithParam<Op> {};
TEST_P(ProcessorOps, AgreeOnEveryInstructionSet) {
  for (const IsaLevel isa : available_isas()) {
    SCOPED_TRACE(to_string(isa));
    compare(GetParam(), {to_string(isa), isa});
  }
}
INSTANTIATE_TEST_SUITE_P(All, ProcessorOps, testing::ValuesIn(all_ops(/*for_gpu=*/false)), name_of);

class GpuOps : public testing::TestWithParam<Op> {};
TEST_P(GpuOps, AgreeWithTheProcessor) {
  if (!has_cuda_engines()) GTEST_SKIP() << "this build has no CUDA engine";
  if (cuda_engines() == nullptr) GTEST_SKIP() << "no GPU that can be used";
  compare(GetParam(), {"cuda", std::nullopt});
}
INSTANTIATE_TEST_SUITE_P(All, GpuOps, testing::ValuesIn(all_ops(/*for_gpu=*/true)), name_of);

}  // namespace
}  // namespace cnerf::test
