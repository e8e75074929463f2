#define CNERF_ISA avx512
#include "bake/splat/tile_kernels.inl"
