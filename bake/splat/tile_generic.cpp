#define CNERF_ISA generic
#include "bake/splat/tile_kernels.inl"
