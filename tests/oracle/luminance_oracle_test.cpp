// LibTorch's autograd as the oracle: the field as in tests/support/torch_oracle.h, compositing out of cumulative sums.

#include <gtest/gtest.h>
#include <torch/torch.h>

#include <cmath>

#include "encoding/cpu/hash_grid_kernels.h"
#include "src/engine/luminance_engine.h"
#include "src/field/nets.h"
#include "tests/support/engine_state.h"
#include "tests/support/finite_difference.h"
#include "tests/support/grouped.h"
#include "tests/support/isa.h"
#include "tests/support/torch_oracle.h"
#include "tests/support/toy_capture.h"

namespace cnerf {
namespace {

HashGridOptions small_grid() {
  return {.levels = 4, .log2_rows = 9, .coarsest_resolution = 3, .finest_resolution = 40};
}

TEST(TorchOracle, HashGridForwardAndBackward) {
  torch::manual_seed(3);
  const std::vector<GridLevel> levels = hash_grid_levels(small_grid());
  const int channels = 4 * int(levels.size());
  const std::int64_t n = 1000;
  const torch::Tensor table = torch::empty({std::int64_t(total_rows(levels)), 4}).uniform_(-1, 1);
  const torch::Tensor positions = torch::rand({n, 3}), upstream = torch::randn({n, channels});
  const auto values_of = [](const torch::Tensor& tensor) {
    return std::vector<float>(tensor.data_ptr<float>(), tensor.data_ptr<float>() + tensor.numel());
  };
  const AlignedVector<float> grouped = test::to_groups(values_of(positions), 3);
  const AlignedVector<float> d_encoded = test::to_groups(values_of(upstream), channels, 0.0f);
  const std::size_t groups = groups_of(std::size_t(n));
  AlignedVector<float> encoded(d_encoded.size()), d_table(std::size_t(table.numel()), 0.0f);
  const std::vector<float> plain_table = values_of(table);
  const AlignedVector<float> aligned_table(plain_table.begin(), plain_table.end());
  const HashGridKernels& kernels = hash_grid_kernels();
  kernels.encode(levels.data(), levels.size(), aligned_table.data(), grouped.data(), groups, encoded.data(), channels);
  for (std::size_t l = 0; l < levels.size(); ++l) {
    kernels.scatter_level(levels[l], grouped.data(), d_encoded.data(), groups, channels, 4 * int(l),
                          d_table.data() + 4 * std::size_t(levels[l].first_row));
  }

  const torch::Tensor leaf = table.to(torch::kFloat64).requires_grad_(true);
  const torch::Tensor expected = test::encode_by_index_select(levels, leaf, positions.to(torch::kFloat64));
  (expected * upstream.to(torch::kFloat64)).sum().backward();
  const torch::Tensor found = torch::tensor(test::from_groups(encoded, channels, std::size_t(n))).view({n, channels});
  const torch::Tensor gradient = torch::tensor(std::vector<float>(d_table.begin(), d_table.end())).view({-1, 4});
  EXPECT_LT((found - expected).abs().max().item<double>(), 1e-4);  // float positions at 40 cells: 40 * 2^-24 * 8
  EXPECT_LT(((gradient - leaf.grad()).norm() / leaf.grad().norm()).item<double>(), 1e-4);
  EXPECT_GT(leaf.grad().norm().item<double>(), 1.0);
}

TEST(TorchOracle, GradientOfAWholeStep) {
  const test::ScopedIsa floats(test::best_float_isa());
  const Capture capture = test::toy_capture(4, 24, 20, /*with_alpha=*/true);
  SceneFrame frame;
  frame.unit_per_world = 0.4;
  const std::vector<TrainingView> views = training_views(capture, frame);
  LuminanceEngineOptions options;
  options.grid = small_grid();
  options.occupancy.resolution = 16;
  options.march = march_settings(1, 24, 0);
  options.samples_per_step = 1024;
  const auto engine = make_cpu_luminance_engine(options);
  engine->set_views(views);
  for (int i = 0; i < 10; ++i) engine->step(1e-2f);
  const test::Stage1Gradients analytic = test::gradients_of_next_step(*engine);

  const auto f64 = torch::TensorOptions().dtype(torch::kFloat64);
  const auto parameter = [&](const auto& values, std::int64_t rows) {
    const std::vector<double> copy(values.begin(), values.end());
    return torch::tensor(copy, f64).view({rows, -1}).requires_grad_(true);
  };
  const std::vector<StatePiece> state = engine->state();
  const std::vector<GridLevel> levels = hash_grid_levels(options.grid);
  const torch::Tensor table = parameter(test::floats_of(state, "grid.table"), std::int64_t(total_rows(levels)));
  const std::vector<torch::Tensor> density_layers = test::layers_of(
      density_net_layout(options.grid.levels), test::floats_of(state, "density_net.weights"), torch::kFloat64);
  const std::vector<torch::Tensor> luminance_layers =
      test::layers_of(luminance_net_layout(), test::floats_of(state, "luminance_net.weights"), torch::kFloat64);

  torch::Tensor loss = torch::zeros({}, f64);
  for (std::size_t r = 0; r < analytic.report.rays; ++r) {
    const ObservedRay ray = observe_ray(views, options.seed, std::uint64_t(engine->step_count()), r);
    RayMarcher marcher(engine->occupancy(), options.march, ray.ray, ray.jitter);
    std::vector<double> positions, dt;
    for (RaySample sample; marcher.next(sample);) {
      const Vec3f p = ray.ray.at(sample.t);
      for (int axis = 0; axis < 3; ++axis) positions.push_back(std::clamp(double(p[axis]), 0.0, 1.0));
      dt.push_back(sample.dt);
    }
    torch::Tensor seen = torch::zeros({}, f64), end = torch::ones({}, f64);
    if (!dt.empty()) {
      const torch::Tensor x = torch::tensor(positions, f64).view({-1, 3});
      const torch::Tensor features = test::run_layers(density_layers, test::encode_by_index_select(levels, table, x));
      const torch::Tensor tau = features.select(1, 0).clamp(-15, 15).exp() * torch::tensor(dt, f64);
      const torch::Tensor direction = test::harmonics(ray.ray.direction.cast<double>()).expand({x.size(0), -1});
      const torch::Tensor raw = test::run_layers(luminance_layers, torch::cat({features, direction}, 1)).select(1, 0);
      const torch::Tensor y = test::luminance_activation(raw, options.max_luminance);
      const torch::Tensor behind = torch::exp(-tau.cumsum(0));
      const torch::Tensor before = torch::cat({torch::ones({1}, f64), behind.slice(0, 0, -1)});
      seen = ((before - behind) * y).sum();
      end = behind.select(0, -1);
    }
    const torch::Tensor wanted =
        torch::full({}, ray.target.luminance + (1.0 - ray.target.coverage) * ray.target.background, f64);
    loss =
        loss + ((test::lightness(seen + end * double(ray.target.background)) - test::lightness(wanted)) / 100).square();
  }
  loss = loss / double(analytic.report.rays);
  loss.backward();

  EXPECT_NEAR(loss.item<double>(), analytic.report.loss, 1e-4 * analytic.report.loss + 1e-6);
  const auto values_of = [](const torch::Tensor& gradient) {
    const torch::Tensor flat = gradient.contiguous().view({-1});
    return std::vector<double>(flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel());
  };
  std::vector<double> d_weights;
  for (const auto* layers : {&density_layers, &luminance_layers}) {
    for (const torch::Tensor& layer : *layers) {
      const std::vector<double> values = values_of(layer.grad());
      d_weights.insert(d_weights.end(), values.begin(), values.end());
    }
  }
  // Float sums over a thousand samples against double, and the tail behind transmittance 1e-4.
  EXPECT_LT(test::relative_distance(analytic.table, values_of(table.grad())), 5e-3);
  EXPECT_LT(test::relative_distance(analytic.weights, d_weights), 5e-3);
}

}  // namespace
}  // namespace cnerf
