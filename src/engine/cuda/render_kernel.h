#pragma once
/// The kernel that renders: rays to pixels, nothing is kept of what lies between.

#include <cuda_runtime_api.h>

#include "src/engine/cuda/trace_kernel.h"

namespace cnerf {

/// Follows the rays of `job` to `job.results`. Answers differ from those of traced samples in what is left dark:
/// samples that together add less than a tenth of an 8-bit step to a pixel.
void render_rays(const TraceJob& job, cudaStream_t stream);

}  // namespace cnerf
