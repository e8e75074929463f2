#define CNERF_ISA avx2
#include "src/field/cpu/mlp_kernels.inl"
