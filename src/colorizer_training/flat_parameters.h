#pragma once
/// All parameters of some modules as one vector, so that an optimizer step is a handful of kernels instead of hundreds.

#include <torch/torch.h>

#include <vector>

namespace cnerf {

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

/// AdamW (Loshchilov and Hutter 2019) with a clipped gradient norm, and an average of the weights over time.
struct AdamWOptions {
  double weight_decay = 0.05;
  double beta1 = 0.9, beta2 = 0.98, epsilon = 1e-8;
  double clip_norm = 1;
};

class FlatAdamW {
 public:
  FlatAdamW(FlatParameters& parameters, const AdamWOptions& options);
  /// @param step  counted from 1.
  void step(double learning_rate, std::int64_t step);

  torch::Tensor first_moment, second_moment;  ///< [N]

 private:
  FlatParameters& parameters_;
  AdamWOptions options_;
};

}  // namespace cnerf
