#pragma once
/// CNERF_HD marks functions that CUDA kernels share with the processor. The CUDA keywords occur here only.

#if defined(__CUDACC__)
#define CNERF_HD __host__ __device__
#else
#define CNERF_HD
#endif
