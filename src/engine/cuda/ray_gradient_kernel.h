#pragma once
/// The loss of training rays that were traced, and its gradient by what their samples emit and absorb (stage1_loss.h).
/// Apart from the kernel that follows rays, which would not fit an instruction cache together with it.

#include <cuda_runtime_api.h>

#include "src/engine/cuda/trace_kernel.h"
#include "src/engine/view_learning.h"
#include "src/field/luminance_activation.h"

namespace cnerf {

struct RayGradientJob {
  LuminanceActivation<float> activation{};
  MarchSettings march;
  const RayRecord* rays = nullptr;
  const RayRuns* runs = nullptr;  ///< of the rays
  SampleArrays samples;           ///< gradients: replaced
  DepthLearning depth;
  float distortion_weight = 0;
  ViewGradient* view_gradients = nullptr;  ///< by the views' gains, added to; null: not asked for
  StepState* state = nullptr;              ///< step and its rays; losses are added up here
};
void differentiate_rays(const RayGradientJob& job, cudaStream_t stream);

}  // namespace cnerf
