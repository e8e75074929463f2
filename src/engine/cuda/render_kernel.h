#pragma once
/// The kernel that renders: rays to pixels, nothing is kept of what lies between.

#include <cuda_runtime_api.h>

#include "src/engine/cuda/trace_kernel.h"

namespace cnerf {

/// Follows the rays of `job` to `job.results`. Answers differ from those of traced samples in what is left dark, 16
/// samples at a time that together add less than a tenth of an 8-bit step to a pixel, and in that samples are not
/// counted: a ray goes on until it is opaque or leaves the box.
void render_rays(const TraceJob& job, cudaStream_t stream);

}  // namespace cnerf
