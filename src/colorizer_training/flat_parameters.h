#pragma once
/// All parameters of some modules as one vector, so that an optimizer step is a handful of kernels instead of hundreds.

#include <torch/torch.h>

#include <vector>

namespace cnerf::colorizer_training {

/// Rebinds the modules' parameters, gradients and float buffers to views of flat tensors. Modules must not be moved to
/// another device afterwards.
class FlatParameters {
 public:
  explicit FlatParameters(const std::vector<torch::nn::Module*>& modules);

  torch::Tensor values;      ///< [N] f32
  torch::Tensor gradients;   ///< [N] f32; views of it are the parameters' grad()
  torch::Tensor buffers;     ///< [M] f32: running statistics
  torch::Tensor decay_mask;  ///< [N] 1 for weights of matrices and convolutions, 0 for biases and norms
};

/// AdamW (Loshchilov and Hutter 2019) with a clipped gradient norm.
class FlatAdamW {
 public:
  explicit FlatAdamW(FlatParameters& parameters);
  /// @param step  counted from 1.
  void step(double learning_rate, std::int64_t step);

  torch::Tensor first_moment, second_moment;  ///< [N]

 private:
  FlatParameters& parameters_;
};

}  // namespace cnerf::colorizer_training
