#pragma once
/// Stage 1's field on the GPU, the counterpart of LuminanceFieldCpu: hash grid, density net, luminance net, and their
/// optimiser state.

#include <cstdint>
#include <vector>

#include "src/field/cuda/field_backward.h"
#include "src/field/cuda/trained_parameters.h"

namespace cnerf {

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
  /// The gradient of the table; after `nets_backward`. Independent of `update_nets`.
  void grid_backward(const FieldSamples& samples, cudaStream_t stream) const;
  /// What the gradient by positions is made of, after `nets_backward` and before the updates.
  [[nodiscard]] PositionSlopes position_slopes(int levels) const;
  [[nodiscard]] const std::vector<GridLevel>& grid_levels() const { return grid_.levels(); }
  /// @param adam  device memory
  void update_nets(const AdamStep* adam, cudaStream_t stream) const;
  /// The grid, whose parts may take their steps one after another.
  [[nodiscard]] const TrainedGrid& grid() const { return grid_; }
  void grid_backward(const LevelRange& range, const FieldSamples& samples, cudaStream_t stream) const {
    grid_.backward(range, samples.places, samples.count, d_encoded_.data(), stream);
  }
  /// The nets' gradient, [field_weight_count(levels())], and a step by such a one.
  void write_nets_gradient(float* to, cudaStream_t stream) const;
  void update_nets(const float* gradient, const AdamStep* adam, cudaStream_t stream) const;
  void update_grid(const AdamStep* adam, cudaStream_t stream) const { grid_.update(adam, stream); }

  void append_state(std::vector<StatePiece>& state);
  /// Copies the state, after it was written to, to the GPU.
  void upload(cudaStream_t stream) const;

 private:
  /// @param d_weights  null: only packs the weights
  void update_layers_of_nets(const float* d_weights, int parts, const AdamStep* adam, cudaStream_t stream) const;

  float density_scale_;
  LuminanceActivation<float> activation_;
  TrainedGrid grid_;
  TrainedNet density_, luminance_;
  PackedBuffers packed_;
  DeviceBuffer<float> last_layer_, d_weights_;
  DeviceBuffer<std::uint16_t> d_encoded_;
};

}  // namespace cnerf
