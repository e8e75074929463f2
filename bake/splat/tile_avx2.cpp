#define CNERF_ISA avx2
#include "bake/splat/tile_kernels.inl"
