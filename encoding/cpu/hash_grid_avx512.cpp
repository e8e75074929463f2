#define CNERF_ISA avx512
#include "encoding/cpu/hash_grid_kernels.inl"
