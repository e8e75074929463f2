#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "src/base/rng.h"
#include "src/field/cpu/mlp_kernels.h"
#include "tests/support/finite_difference.h"
#include "tests/support/grouped.h"
#include "tests/support/isa.h"
#include "tests/support/mlp_reference.h"

namespace cnerf {
namespace {

using test::from_groups;
using test::to_groups;

const MlpLayout kLayout = {{12, 20, 16, 4}};

std::vector<double> random_values(std::size_t n, std::uint64_t stream) {
  const CounterRng rng(99, stream);
  std::vector<double> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = 2.0 * rng.uniform(i) - 1.0;
  return values;
}

MlpReference<double> random_net() {
  MlpReference<double> net{kLayout, {}};
  for (const float w : initial_weights(kLayout, 5, 1)) net.weights.push_back(w);
  return net;
}

TEST(Mlp, ReferenceGradientMatchesCentralDifference) {
  const MlpReference<double> net = random_net();
  const std::vector<double> input = random_values(12, 1), d_out = random_values(4, 2);
  const auto loss = [&](const MlpReference<double>& at, const std::vector<double>& x) {
    const std::vector<double> out = at.forward(x).back();
    double sum = 0;
    for (std::size_t i = 0; i < out.size(); ++i) sum += out[i] * d_out[i];
    return sum;
  };
  std::vector<double> d_weights(kLayout.weight_count(), 0.0);
  const std::vector<double> d_input = net.backward(net.forward(input), d_out, d_weights);

  std::vector<std::size_t> all_weights(kLayout.weight_count()), all_inputs(12);
  for (std::size_t i = 0; i < all_weights.size(); ++i) all_weights[i] = i;
  for (std::size_t i = 0; i < all_inputs.size(); ++i) all_inputs[i] = i;
  const auto numeric_weights = test::central_difference(net.weights, all_weights, 1e-6, [&](const auto& w) {
    return loss({kLayout, w}, input);
  });
  const auto numeric_input =
      test::central_difference(input, all_inputs, 1e-6, [&](const auto& x) { return loss(net, x); });
  EXPECT_LT(test::worst_relative_error(d_weights, numeric_weights), 1e-6);
  EXPECT_LT(test::worst_relative_error(d_input, numeric_input), 1e-6);
  EXPECT_GT(test::worst_relative_error(std::vector<double>(d_weights.size(), 0.0), numeric_weights), 0.5);
}

class MlpBackends : public testing::TestWithParam<std::tuple<IsaLevel, std::size_t>> {};

std::vector<IsaLevel> isas_of_nets() {
  std::vector<IsaLevel> isas = test::available_isas();
  if (detected_isa() == IsaLevel::kAvx512Bf16) isas.push_back(IsaLevel::kAvx512Bf16);
  return isas;
}

/// How far a sum of products may lie from the exact one. Floats: 20 multiply-adds of values below 1. A number that is
/// rounded to the 8 bits of bf16 is off by 2^-8 of itself at most, and a product has two of them.
double bound(IsaLevel isa, double sum_of_sizes) {
  return 5e-6 + (isa == IsaLevel::kAvx512Bf16 ? (std::ldexp(1.0, -7) + std::ldexp(1.0, -16)) * sum_of_sizes : 0.0);
}

/// Sizes of all numbers.
MlpReference<double> sizes_of(MlpReference<double> net) {
  for (double& weight : net.weights) weight = std::abs(weight);
  return net;
}
std::vector<double> sizes_of(std::vector<double> values) {
  for (double& value : values) value = std::abs(value);
  return values;
}

/// One layer of 12 -> 20 with ReLU behind it, forward and both gradients, against the double reference.
TEST_P(MlpBackends, EqualReference) {
  const auto [isa, n] = GetParam();
  const test::ScopedIsa scope(isa);
  constexpr int kIn = 12, kOut = 20;
  const MlpLayout layer = {{kIn, kOut}};
  const MlpReference<double> net{layer, random_values(layer.weight_count(), 3)};
  const std::vector<float> w(net.weights.begin(), net.weights.end());
  std::vector<float> w_transposed(w.size());
  for (int o = 0; o < kOut; ++o) {
    for (int i = 0; i < kIn; ++i) w_transposed[i * kOut + o] = w[o * kIn + i];
  }
  const std::vector<double> in = random_values(n * kIn, 4), d_out = random_values(n * kOut, 5);
  const AlignedVector<float> in_groups = to_groups(in, kIn, 0.0f), d_out_groups = to_groups(d_out, kOut, 0.0f);
  const std::size_t groups = groups_of(n);

  AlignedVector<float> out(groups * kOut * kGroup), d_in(groups * kIn * kGroup);
  mlp_kernels().forward(w_transposed.data(), kIn, kOut, in_groups.data(), kIn, out.data(), kOut, groups, true);
  mlp_kernels().backward_input(w.data(), kIn, kOut, d_out_groups.data(), kOut, d_in.data(), kIn, groups,
                               in_groups.data(), kIn);
  std::vector<float> d_w(w.size(), 0.0f);
  mlp_kernels().backward_weights(in_groups.data(), kIn, d_out_groups.data(), kOut, groups, kIn, kOut, d_w.data());

  const MlpReference<double> net_of_sizes = sizes_of(net);
  std::vector<double> expected_d_w(w.size(), 0.0), d_w_sizes(w.size(), 0.0);
  const std::vector<float> got_out = from_groups(out, kOut, n), got_d_in = from_groups(d_in, kIn, n);
  for (std::size_t s = 0; s < n; ++s) {
    const std::vector<double> x(in.begin() + s * kIn, in.begin() + (s + 1) * kIn);
    const auto activations = net.forward(x);
    const std::vector<double> dy(d_out.begin() + s * kOut, d_out.begin() + (s + 1) * kOut);
    const std::vector<double> expected_d_in = net.backward(activations, dy, expected_d_w);
    const auto sizes = net_of_sizes.forward(sizes_of(x));
    const std::vector<double> d_in_sizes = net_of_sizes.backward(sizes, sizes_of(dy), d_w_sizes);
    for (int o = 0; o < kOut; ++o) {
      ASSERT_NEAR(got_out[s * kOut + o], std::max(0.0, activations[1][o]), bound(isa, sizes[1][o]));
    }
    for (int i = 0; i < kIn; ++i) {
      ASSERT_NEAR(got_d_in[s * kIn + i], x[i] > 0 ? expected_d_in[i] : 0.0, bound(isa, d_in_sizes[i]));
    }
  }
  if (n == 0) return;
  if (isa == IsaLevel::kAvx512Bf16) {
    for (std::size_t i = 0; i < d_w.size(); ++i) ASSERT_NEAR(d_w[i], expected_d_w[i], bound(isa, d_w_sizes[i]));
    EXPECT_LT(test::relative_distance(d_w, expected_d_w), 4e-3);  // measured 2.4e-3: roundings mostly cancel
  } else {
    EXPECT_LT(test::relative_distance(d_w, expected_d_w), 2e-6);
  }
}

/// A training that diverges is found by what its last layer says.
TEST_P(MlpBackends, WhatIsNoNumberStaysSo) {
  const auto [isa, n] = GetParam();
  const test::ScopedIsa scope(isa);
  constexpr int kIn = 12, kOut = 20, kLost = 7;
  const std::vector<double> values = random_values(std::size_t(kIn) * kOut, 6);
  std::vector<float> w_transposed(values.begin(), values.end());
  w_transposed[3 * kOut + kLost] = std::numeric_limits<float>::quiet_NaN();
  const AlignedVector<float> in_groups = to_groups(random_values(n * kIn, 7), kIn, 0.0f);
  const std::size_t groups = groups_of(n);
  AlignedVector<float> out(groups * kOut * kGroup);
  mlp_kernels().forward(w_transposed.data(), kIn, kOut, in_groups.data(), kIn, out.data(), kOut, groups, false);
  const std::vector<float> found = from_groups(out, kOut, n);
  for (std::size_t i = 0; i < found.size(); ++i) ASSERT_EQ(std::isnan(found[i]), i % kOut == kLost) << i;
}

INSTANTIATE_TEST_SUITE_P(
    All, MlpBackends, testing::Combine(testing::ValuesIn(isas_of_nets()), testing::Values(0, 1, 15, 16, 17, 33, 1000)),
    [](const auto& param_info) {
      return to_string(std::get<0>(param_info.param)) + "_" + std::to_string(std::get<1>(param_info.param));
    });

}  // namespace
}  // namespace cnerf
