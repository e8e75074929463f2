#define CNERF_ISA avx512
#include "src/field/cpu/mlp_kernels.inl"
