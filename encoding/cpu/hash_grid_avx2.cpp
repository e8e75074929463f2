#define CNERF_ISA avx2
#include "encoding/cpu/hash_grid_kernels.inl"
