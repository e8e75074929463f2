#define CNERF_ISA generic
#include "src/field/cpu/mlp_kernels.inl"
