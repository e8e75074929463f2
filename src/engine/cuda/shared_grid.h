#pragma once
/// A hash grid whose gradient several processes find together. Each sums and updates a piece of the table and hands the
/// rounded values round (the first stage of ZeRO, Rajbhandari et al. 2020), so that Adam's work is shared as well.

#include <cuda_runtime_api.h>

#include <vector>

#include "src/engine/step_share.h"
#include "src/field/cuda/trained_parameters.h"

namespace cnerf {

class SharedGrid {
 public:
  /// @param grid  must outlive this, as what `share` points to must
  SharedGrid(const TrainedGrid& grid, const StepShare& share);

  /// Levels whose gradient is found and summed at once, from the finest ones to the coarsest.
  [[nodiscard]] const std::vector<LevelRange>& parts() const { return parts_; }
  // In this order, each by all processes, of one part after another.
  /// Rounds the gradient to bfloat16, since it takes longer to exchange than to find.
  void pack(const LevelRange& part, cudaStream_t stream) const;
  void sum(const LevelRange& part, cudaStream_t stream) const;
  /// @param adam  device memory
  void update(const LevelRange& part, const AdamStep* adam, cudaStream_t stream) const;
  void hand_round(const LevelRange& part, cudaStream_t stream) const;

  /// Gives each process what the others have updated: values and moments, which steps need of its own pieces only.
  void complete(cudaStream_t stream) const;

 private:
  [[nodiscard]] TableRowsCuda own(const LevelRange& part) const;
  [[nodiscard]] uint2* packed(const LevelRange& part) const;

  const TrainedGrid& grid_;
  DeviceSums& sums_;
  int piece_, pieces_;
  std::vector<LevelRange> parts_;
  DeviceBuffer<uint2> packed_;  // [rows] gradients, where each process updates a piece
};

}  // namespace cnerf
