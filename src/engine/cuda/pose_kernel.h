#pragma once
/// What the samples of a training step say of the poses of their views, and of their lenses.

#include <cuda_runtime_api.h>

#include "encoding/cuda/hash_grid_cuda.h"
#include "src/engine/cuda/step_kernels.h"

namespace cnerf {

struct PoseJob {
  LearnedViews learned;  ///< its gradients are added to
  const ViewRecord* views;
  SampleCount count;
  const float4* places;  ///< x, y, z in [0, 1]; w holds the bits of the ray's number
  const RayRecord* rays;
};
/// Of the rays that teach them (view_learning.h). After the nets' backward pass; float sums in an order that varies.
void add_camera_gradients(const PositionSlopes& slopes, const PoseJob& job, cudaStream_t stream);

}  // namespace cnerf
