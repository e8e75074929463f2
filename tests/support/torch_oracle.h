#pragma once
/// Stage 1's field out of LibTorch's own operators: the hash grid from index_select, the nets from matrix products. No
/// line of it is shared with the engine, whose oracle (tests) and yardstick (benchmarks) it is. Works in f32 and f64.

#include <torch/torch.h>

#include <cmath>
#include <span>
#include <vector>

#include "encoding/hash_grid_levels.h"
#include "encoding/spherical_harmonics_math.h"
#include "src/base/vec3.h"
#include "src/field/mlp_layout.h"

namespace cnerf::test {

/// Plain trilinear lookup.  @param table [rows, 4]  @param positions [n, 3], 0..1  @return [n, 4 L]
inline torch::Tensor encode_by_index_select(const std::vector<GridLevel>& levels, const torch::Tensor& table,
                                            const torch::Tensor& positions) {
  std::vector<torch::Tensor> encoded;
  for (const GridLevel& level : levels) {
    const torch::Tensor scaled = positions * double(level.cells);
    const torch::Tensor corner = scaled.floor();
    const torch::Tensor fraction = scaled - corner;
    const torch::Tensor base = corner.to(torch::kInt64);
    torch::Tensor sum = torch::zeros({positions.size(0), 4}, table.options());
    for (int c = 0; c < 8; ++c) {
      torch::Tensor weight = torch::ones({positions.size(0)}, positions.options());
      std::vector<torch::Tensor> point;
      for (int axis = 0; axis < 3; ++axis) {
        const bool upper = ((c >> axis) & 1) != 0;
        const torch::Tensor f = fraction.select(1, axis);
        weight = weight * (upper ? f : 1 - f);
        point.push_back(base.select(1, axis) + (upper ? 1 : 0));
      }
      torch::Tensor row;
      if (level.hashed) {
        const torch::Tensor mask32 = torch::full_like(point[0], std::int64_t(0xffffffff));
        row = torch::bitwise_xor(
                  torch::bitwise_xor(point[0], torch::bitwise_and(point[1] * std::int64_t(2654435761), mask32)),
                  torch::bitwise_and(point[2] * std::int64_t(805459861), mask32)) %
              std::int64_t(level.rows);
      } else {
        const std::int64_t stride = std::int64_t(level.cells) + 1;
        row = point[0] + stride * (point[1] + stride * point[2]);
      }
      sum = sum + weight.unsqueeze(1) * table.index_select(0, row + std::int64_t(level.first_row));
    }
    encoded.push_back(sum);
  }
  return torch::cat(encoded, 1);
}

/// The net's layers as leaves that want gradients: [out, in] each.
inline std::vector<torch::Tensor> layers_of(const MlpLayout& layout, std::span<const float> weights,
                                            torch::Dtype dtype) {
  std::vector<torch::Tensor> layers;
  for (int l = 0; l < layout.layers(); ++l) {
    const std::vector<float> w(weights.begin() + long(layout.weight_offset(l)),
                               weights.begin() + long(layout.weight_offset(l + 1)));
    const std::int64_t outputs = layout.widths[std::size_t(l) + 1];
    layers.push_back(torch::tensor(w).to(dtype).view({outputs, -1}).requires_grad_(true));
  }
  return layers;
}

/// ReLU between the layers, none behind the last.  @param x [n, in]
inline torch::Tensor run_layers(const std::vector<torch::Tensor>& layers, torch::Tensor x) {
  for (std::size_t l = 0; l < layers.size(); ++l) {
    x = x.matmul(layers[l].t());
    if (l + 1 < layers.size()) x = torch::relu(x);
  }
  return x;
}

inline torch::Tensor lightness(const torch::Tensor& y) {
  const double epsilon = 216.0 / 24389.0, kappa = 24389.0 / 27.0;
  return torch::where(y > epsilon, 116 * y.clamp_min(epsilon).pow(1.0 / 3.0) - 16, kappa * y);
}

inline torch::Tensor luminance_of_lightness(const torch::Tensor& lightness) {
  const torch::Tensor cube = ((lightness + 16) / 116).pow(3);
  return torch::where(lightness > 8, cube, lightness * (27.0 / 24389.0));
}

/// What the luminance net's first output means.  @param most  the brightest that the images hold, linear, over 0.01
inline torch::Tensor luminance_activation(const torch::Tensor& raw, double most) {
  const double brightest = 116 * std::cbrt(1.05 * most) - 16;
  return luminance_of_lightness(brightest * torch::sigmoid(raw));
}

/// [kSphericalHarmonics] f64.
inline torch::Tensor harmonics(Vec3d d) {
  std::vector<double> values(kSphericalHarmonics);
  spherical_harmonics(d.x, d.y, d.z, [&](int i, double value) { values[std::size_t(i)] = value; });
  return torch::tensor(values, torch::kFloat64);
}

}  // namespace cnerf::test
