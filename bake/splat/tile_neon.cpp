#define CNERF_ISA neon
#define CNERF_NEON
#include "bake/splat/tile_kernels.inl"
