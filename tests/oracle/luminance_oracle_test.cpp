// LibTorch's autograd as the oracle: the field as in tests/support/torch_oracle.h, compositing out of cumulative sums.

#include <gtest/gtest.h>
#include <torch/torch.h>

#include <cmath>

#include "encoding/torch/hash_grid.h"
#include "src/base/error.h"
#include "src/engine/cpu/luminance_engine_cpu.h"
#include "tests/support/finite_difference.h"
#include "tests/support/torch_oracle.h"
#include "tests/support/toy_capture.h"

namespace cnerf {
namespace {

HashGridOptions small_grid() {
  return {.levels = 4, .log2_rows = 9, .coarsest_resolution = 3, .finest_resolution = 40};
}

TEST(TorchOracle, HashGridModuleForwardAndBackward) {
  torch::manual_seed(3);
  HashGrid grid(small_grid());
  {
    const torch::NoGradGuard guard;
    grid->table.uniform_(-1, 1);
  }
  const torch::Tensor positions = torch::rand({1000, 3});
  const torch::Tensor upstream = torch::randn({1000, 16});
  const torch::Tensor encoded = grid->forward(positions);
  (encoded * upstream).sum().backward();

  const torch::Tensor table = grid->table.detach().to(torch::kFloat64).requires_grad_(true);
  const torch::Tensor expected = test::encode_by_index_select(grid->levels(), table, positions.to(torch::kFloat64));
  (expected * upstream.to(torch::kFloat64)).sum().backward();
  EXPECT_LT((encoded - expected).abs().max().item<double>(), 1e-4);  // float positions at 40 cells: 40 * 2^-24 * 8
  EXPECT_LT(((grid->table.grad() - table.grad()).norm() / table.grad().norm()).item<double>(), 1e-4);
  EXPECT_GT(table.grad().norm().item<double>(), 1.0);
}

TEST(TorchOracle, HashGridModuleRefusesWhatItCannotTake) {
  HashGrid grid(small_grid());
  EXPECT_THROW(grid->forward(torch::rand({5, 2})), ContractError);
  EXPECT_THROW(grid->forward(torch::rand({5, 3}, torch::kFloat64)), ContractError);
  EXPECT_THROW(grid->forward(torch::rand({5, 3}) + 1), ContractError);
  EXPECT_EQ(grid->forward(torch::rand({0, 3})).size(0), 0);
}

TEST(TorchOracle, GradientOfAWholeStep) {
  const Capture capture = test::toy_capture(4, 24, 20, /*with_alpha=*/true);
  SceneFrame frame;
  frame.unit_per_world = 0.4;
  const std::vector<TrainingView> views = training_views(capture, frame);
  LuminanceEngineOptions options;
  options.grid = small_grid();
  options.occupancy.resolution = 16;
  options.march = march_settings(1, 24, 0);
  options.samples_per_step = 1024;
  LuminanceEngineCpu engine(options);
  for (int i = 0; i < 10; ++i) engine.step(views, 1e-2f);
  const LuminanceEngineCpu::Gradients analytic = engine.gradients(views);

  const auto f64 = torch::TensorOptions().dtype(torch::kFloat64);
  const auto parameter = [&](const auto& values, std::int64_t rows) {
    const std::vector<double> copy(values.begin(), values.end());
    return torch::tensor(copy, f64).view({rows, -1}).requires_grad_(true);
  };
  std::vector<StatePiece> state = engine.state();
  const auto* table_values = reinterpret_cast<const float*>(state.front().bytes.data());
  const std::vector<float> table_copy(table_values, table_values + state.front().bytes.size() / sizeof(float));
  const torch::Tensor table = parameter(table_copy, std::int64_t(table_copy.size() / 4));
  const std::vector<torch::Tensor> density_layers = test::layers_of(engine.field().density_net(), torch::kFloat64);
  const std::vector<torch::Tensor> luminance_layers = test::layers_of(engine.field().luminance_net(), torch::kFloat64);

  torch::Tensor loss = torch::zeros({}, f64);
  for (std::size_t r = 0; r < analytic.report.rays; ++r) {
    const auto ray = engine.observe(views, r);
    RayMarcher marcher(engine.occupancy(), options.march, ray.ray, ray.jitter);
    std::vector<double> positions, dt;
    for (RaySample sample; marcher.next(sample);) {
      const Vec3f p = ray.ray.at(sample.t);
      for (int axis = 0; axis < 3; ++axis) positions.push_back(std::clamp(double(p[axis]), 0.0, 1.0));
      dt.push_back(sample.dt);
    }
    torch::Tensor seen = torch::zeros({}, f64), end = torch::ones({}, f64);
    if (!dt.empty()) {
      const torch::Tensor x = torch::tensor(positions, f64).view({-1, 3});
      const torch::Tensor features =
          test::run_layers(density_layers, test::encode_by_index_select(engine.field().grid().levels(), table, x));
      const torch::Tensor tau = features.select(1, 0).clamp(-15, 15).exp() * torch::tensor(dt, f64);
      const torch::Tensor direction = test::harmonics(ray.ray.direction.cast<double>()).expand({x.size(0), -1});
      const torch::Tensor raw = test::run_layers(luminance_layers, torch::cat({features, direction}, 1)).select(1, 0);
      const torch::Tensor y = test::luminance_activation(raw, options.max_luminance);
      const torch::Tensor behind = torch::exp(-tau.cumsum(0));
      const torch::Tensor before = torch::cat({torch::ones({1}, f64), behind.slice(0, 0, -1)});
      seen = ((before - behind) * y).sum();
      end = behind.select(0, -1);
    }
    const torch::Tensor wanted = torch::full({}, ray.target.luminance + (1.0 - ray.target.coverage) * ray.target.background, f64);
    loss = loss + ((test::lightness(seen + end * double(ray.target.background)) - test::lightness(wanted)) / 100).square();
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
