#include "tests/engine/gpu_kernels.h"

#include <cmath>
#include <cstdint>
#include <cstring>

#include "encoding/cuda/hash_grid_cuda.h"
#include "src/base/cuda/device_memory.h"
#include "src/field/cuda/channel_tiles.h"
#include "src/field/cuda/point_kernels.h"
#include "src/optim/cuda/row_adam_cuda.h"

namespace cnerf::test {
namespace {

/// Of a value that half precision holds.
std::uint16_t half_of(float value) {
  const float magnitude = std::abs(value);
  if (magnitude == 0) return 0;
  const int exponent = std::max(std::ilogb(magnitude), -14);
  const auto code = std::uint16_t(int(std::nearbyint(std::ldexp(magnitude, 10 - exponent))) + ((exponent + 14) << 10));
  return std::uint16_t(code | (value < 0 ? 0x8000 : 0));
}
float float_of_half(std::uint16_t half) {
  const int exponent = (half >> 10) & 31, mantissa = half & 1023;
  const float magnitude =
      exponent == 0 ? std::ldexp(float(mantissa), -24) : std::ldexp(float(mantissa + 1024), exponent - 25);
  return (half & 0x8000) != 0 ? -magnitude : magnitude;
}
/// Of a value that bfloat16 holds.
std::uint16_t bfloat_of(float value) {
  std::uint32_t word = 0;
  std::memcpy(&word, &value, sizeof(value));
  return std::uint16_t(word >> 16);
}

template <typename T>
T* as(const auto& buffer) {
  return reinterpret_cast<T*>(buffer.data());
}

}  // namespace

std::vector<float> gpu_encode(const std::vector<GridLevel>& levels, const std::vector<float>& table,
                              const std::vector<float>& positions) {
  std::vector<std::uint16_t> halves;
  for (const float value : table) halves.push_back(half_of(value));
  std::vector<Vec3f> points;
  for (std::size_t i = 0; i < positions.size(); i += 3) {
    points.push_back({positions[i], positions[i + 1], positions[i + 2]});
  }
  const auto d_table = uploaded(halves, "test");
  const auto d_points = uploaded(points, "test");
  // The net behind the grid has weights of zero; what is looked at are the features that it keeps for training.
  const int n_levels = int(levels.size()), padded = 16 * channel_tiles(n_levels);
  const DeviceBuffer<std::uint16_t> weights(std::size_t(point_weight_count(PointOutputs::kNumbers, n_levels)), "test");
  const DeviceBuffer<std::uint16_t> encoded(points.size() * std::size_t(padded), "test");
  const DeviceBuffer<float> numbers(2 * points.size(), "test");
  PointForwardJob job{&levels, as<const uint2>(d_table), as<const uint2>(weights), d_points.data(),
                      std::uint32_t(points.size())};
  job.encoded = as<uint4>(encoded);
  job.numbers = as<float2>(numbers);
  point_forward(PointOutputs::kNumbers, job, nullptr);
  CNERF_CUDA(cudaDeviceSynchronize());
  const std::vector<std::uint16_t> rows = encoded.downloaded();
  std::vector<float> found;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (int c = 0; c < 4 * n_levels; ++c) {
      found.push_back(float_of_half(rows[i * std::size_t(padded) + std::size_t(c)]));
    }
  }
  return found;
}

std::vector<float> gpu_encode_backward(const std::vector<GridLevel>& levels, const std::vector<float>& positions,
                                       const std::vector<float>& d_encoded) {
  const std::size_t count = positions.size() / 3, capacity = count + 469;  // room that is not filled
  std::vector<float> places;
  for (std::size_t i = 0; i < count; ++i) {
    places.insert(places.end(), {positions[3 * i], positions[3 * i + 1], positions[3 * i + 2], 0.0f});
  }
  places.resize(4 * capacity);
  std::vector<std::uint16_t> gradients(levels.size() * capacity * 4, 0);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t l = 0; l < levels.size(); ++l) {
      for (std::size_t f = 0; f < 4; ++f) {
        gradients[(l * capacity + i) * 4 + f] = bfloat_of(d_encoded[(i * levels.size() + l) * 4 + f]);
      }
    }
  }
  const auto d_places = uploaded(places, "test");
  const auto d_gradients = uploaded(gradients, "test");
  const auto d_count = uploaded(std::vector<std::uint32_t>{std::uint32_t(count)}, "test");
  const DeviceBuffer<float> d_table(std::size_t(total_rows(levels)) * 4, "test");
  encode_backward_cuda(levels, as<float4>(d_places), {d_count.data(), std::uint32_t(capacity)}, d_gradients.data(),
                       as<float4>(d_table), nullptr);
  CNERF_CUDA(cudaDeviceSynchronize());
  return d_table.downloaded();
}

void gpu_update_rows(RowProblem& problem) {
  const auto values = uploaded(problem.values, "test");
  const auto gradient = uploaded(problem.gradient, "test");
  const auto moments = uploaded(problem.moments, "test");
  const auto step = uploaded(std::vector<AdamStep>{problem.step}, "test");
  const DeviceBuffer<std::uint16_t> halves(problem.values.size(), "test");
  update_rows({as<float4>(values), as<float4>(gradient), as<float4>(moments), as<uint2>(halves),
               std::uint32_t(problem.values.size() / 4)},
              nullptr, step.data(), problem.decay, nullptr);
  CNERF_CUDA(cudaDeviceSynchronize());
  problem.values = values.downloaded();
  problem.moments = moments.downloaded();
}

}  // namespace cnerf::test
