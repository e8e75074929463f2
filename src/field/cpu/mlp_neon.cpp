#define CNERF_ISA neon
#define CNERF_NEON
#include "src/field/cpu/mlp_kernels.inl"
