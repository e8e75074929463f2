#pragma once
/// CNERF_HD marks the functions that a CUDA kernel shares with the CPU. The only place where the keywords occur.

#if defined(__CUDACC__)
#define CNERF_HD __host__ __device__
#else
#define CNERF_HD
#endif
