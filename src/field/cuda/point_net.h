#pragma once
/// A trainable hash grid and small net over points on the GPU: the counterpart of the CPU's PointNetCpu.

#include <cstdint>
#include <string>
#include <vector>

#include "src/field/cuda/point_kernels.h"
#include "src/field/cuda/trained_parameters.h"

namespace cnerf {

class PointNetCuda {
 public:
  PointNetCuda(const HashGridOptions& grid, PointOutputs outputs, std::uint64_t seed);

  /// @param for_training  keeps what `backward` needs
  void forward(const Vec3f* positions, std::uint32_t count, bool for_training, cudaStream_t stream);
  /// Of the latest `forward`; features or numbers, whichever the net has.
  [[nodiscard]] const std::uint32_t* features() const { return features_.data(); }  ///< [count, 64] halves
  [[nodiscard]] const float2* numbers() const { return numbers_.data(); }

  /// @param samples  those of the latest `forward`
  void backward(const float4* places, SampleCount samples, const PointGradient& gradient, cudaStream_t stream);
  /// Adam, after `backward`.
  /// @param adam    device memory
  /// @param others  processes to sum the gradient with; null: none
  void update(const AdamStep* adam, DeviceSums* others, cudaStream_t stream) const;

  void append_state(const std::string& prefix, std::vector<StatePiece>& state);
  void upload(cudaStream_t stream) const;

 private:
  [[nodiscard]] int levels() const { return int(grid_.levels().size()); }
  void update_net(const AdamStep* adam, const float* d_weights, int parts, cudaStream_t stream) const;

  PointOutputs outputs_;
  TrainedGrid grid_;
  TrainedNet net_;
  PackedBuffers packed_;
  DeviceBuffer<float> d_weights_;
  DeviceBuffer<uint4> encoded_;
  DeviceBuffer<std::uint16_t> d_encoded_;
  DeviceBuffer<std::uint32_t> features_;
  DeviceBuffer<float2> numbers_;
};

}  // namespace cnerf
