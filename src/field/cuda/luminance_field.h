#pragma once
/// Stage 1's field on the GPU, as LuminanceFieldCpu is it on the processor: hash grid, density net, luminance net, and
/// what Adam keeps of them.

#include <cstdint>
#include <vector>

#include "src/field/cuda/field_backward.h"
#include "src/field/cuda/trained_parameters.h"

namespace cnerf {

/// Samples of a training step with the gradient of the loss, in device memory.
struct FieldSamples {
  SampleCount count;
  const float4* places = nullptr;             ///< x, y, z in [0, 1]; w holds the bits of the ray's number
  const DirectionCode* directions = nullptr;  ///< of the rays
  const uint4* encoded = nullptr;             ///< [most, 16 KT] halves
  const float2* gradients = nullptr;          ///< by the luminance net's raw output and by log density
};

class LuminanceFieldCuda {
 public:
  /// @param most_samples   of a step
  /// @param density_scale  see density_from_raw
  LuminanceFieldCuda(const HashGridOptions& grid, float density_scale, float max_luminance, std::uint32_t most_samples,
                     std::uint64_t seed);

  [[nodiscard]] FieldView view() const;
  [[nodiscard]] int levels() const { return int(grid_.levels().size()); }

  /// Gradients of the weights, and of what the hash grid's levels receive.
  void nets_backward(const FieldSamples& samples, cudaStream_t stream) const;
  /// After `nets_backward`: the gradient of the table. Needs nothing of `update_nets`, nor the other way round.
  void grid_backward(const FieldSamples& samples, cudaStream_t stream) const;
  /// @param adam  device memory
  void update_nets(const AdamStep* adam, cudaStream_t stream) const;
  void update_grid(const AdamStep* adam, cudaStream_t stream) const { grid_.update(adam, stream); }

  void append_state(std::vector<StatePiece>& state);
  /// What was written into the state goes to the GPU.
  void upload(cudaStream_t stream) const;

 private:
  /// @param d_weights  null: only packs the weights
  void update_layers_of_nets(const float* d_weights, const AdamStep* adam, cudaStream_t stream) const;

  float density_scale_;
  LuminanceActivation<float> activation_;
  TrainedGrid grid_;
  TrainedNet density_, luminance_;
  DeviceBuffer<std::uint16_t> forward_, backward_;  // packed weights
  DeviceBuffer<float> last_layer_, d_weights_;
  DeviceBuffer<std::uint16_t> d_encoded_;
};

}  // namespace cnerf
