#include "src/field/cpu/mlp_bf16_kernels.inl"
