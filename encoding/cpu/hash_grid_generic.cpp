#define CNERF_ISA generic
#include "encoding/cpu/hash_grid_kernels.inl"
