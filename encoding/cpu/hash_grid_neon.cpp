#define CNERF_ISA neon
#define CNERF_NEON
#include "encoding/cpu/hash_grid_kernels.inl"
