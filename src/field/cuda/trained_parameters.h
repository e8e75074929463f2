#pragma once
/// Trainable parameters on the GPU, with the host copies that snapshots read and write. Names and shapes of the pieces
/// equal those of HashGridCpu and MlpCpu, so that a snapshot of one device loads on the other.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "encoding/cuda/hash_grid_cuda.h"
#include "src/base/cuda/device_memory.h"
#include "src/field/cuda/dense_layer.h"
#include "src/field/state.h"
#include "src/optim/cuda/row_adam_cuda.h"

namespace cnerf {

/// Floats on the GPU and their copy on the host.
class StateBuffer {
 public:
  StateBuffer() = default;
  /// @param use  for the error message, see DeviceBuffer
  StateBuffer(std::vector<float> initial, const std::string& use)
      : host_(std::move(initial)), device_(uploaded(host_, use)) {}

  [[nodiscard]] float* data() const { return device_.data(); }
  /// The host copy, updated from the GPU. Changes to it take effect with `upload`.
  [[nodiscard]] StatePiece fetched(std::string name) {
    device_.download(host_.data(), host_.size());
    return state_piece(std::move(name), host_);
  }
  void upload() const { device_.upload(host_.data(), host_.size()); }

 private:
  std::vector<float> host_;
  DeviceBuffer<float> device_;
};

/// Owns packed weights.
class PackedBuffers {
 public:
  /// @param weights  a multiple of 4
  explicit PackedBuffers(int weights)
      : forward_(std::size_t(weights) / 4, "nets"), backward_(std::size_t(weights) / 4, "nets") {}

  [[nodiscard]] PackedWeights weights() const { return {forward_.data(), backward_.data()}; }

 private:
  DeviceBuffer<uint2> forward_, backward_;
};

/// A net's weights.
class TrainedNet {
 public:
  TrainedNet() = default;
  explicit TrainedNet(std::vector<float> initial);

  [[nodiscard]] TrainedWeights weights() const { return {weights_.data(), first_.data(), second_.data()}; }
  void append_state(const std::string& prefix, std::vector<StatePiece>& state);
  void upload() const;

 private:
  StateBuffer weights_, first_, second_;
};

/// Levels of a hash grid that follow one another, and so do their rows.
struct LevelRange {
  std::size_t first = 0, last = 0;  ///< the one behind the last
};

/// A hash grid: its table, rounded for kernels, its gradient and its moments.
class TrainedGrid {
 public:
  TrainedGrid() = default;
  /// @param use  for the error message, see DeviceBuffer
  TrainedGrid(const HashGridOptions& options, std::uint64_t seed, const std::string& use);

  [[nodiscard]] const std::vector<GridLevel>& levels() const { return levels_; }
  /// [rows, 4] halves
  [[nodiscard]] const uint2* table() const { return halves_.data(); }

  /// Adds to the gradient, as encode_backward_cuda does.
  void backward(const float4* places, SampleCount samples, const void* d_encoded, cudaStream_t stream) const {
    backward(all(), places, samples, d_encoded, stream);
  }
  /// Adam on what has a gradient.  @param adam  device memory
  void update(const AdamStep* adam, cudaStream_t stream) const { update(rows(all()), nullptr, adam, stream); }

  // The same of some levels, whose gradient is then summed with that of other processes.
  [[nodiscard]] LevelRange all() const { return {0, levels_.size()}; }
  void backward(const LevelRange& range, const float4* places, SampleCount samples, const void* d_encoded,
                cudaStream_t stream) const;
  [[nodiscard]] TableRowsCuda rows(const LevelRange& range) const;
  [[nodiscard]] std::span<float> gradient() const {  ///< device memory
    return {reinterpret_cast<float*>(d_table_.data()), 4 * std::size_t(total_rows(levels_))};
  }
  /// @param packed  null: the rows' own gradient; else see `pack_gradient`
  void update(const TableRowsCuda& some, const uint2* packed, const AdamStep* adam, cudaStream_t stream) const {
    update_rows(some, packed, adam, decay_, stream);
  }
  void append_state(const std::string& prefix, std::vector<StatePiece>& state);
  void upload(cudaStream_t stream) const;

 private:
  std::vector<GridLevel> levels_;
  float decay_ = 0;
  StateBuffer table_, moments_;  // [rows, 4], [rows, 8]
  DeviceBuffer<float4> d_table_;
  DeviceBuffer<uint2> halves_;
};

}  // namespace cnerf
