#pragma once
/// Features of a frozen image classifier (SqueezeNet 1.1, the layers LPIPS uses) of the *colour* picture. A grey-to-
/// colour network that must predict them learns what things are, which is what colours hang on.

#include <torch/torch.h>

#include <filesystem>
#include <map>
#include <string>

#include "src/base/tensor_file.h"

namespace cnerf::colorizer_training {

class FeatureTeacher {
 public:
  static constexpr std::int64_t kChannels = 512;

  /// @param weights  LPIPS's SqueezeNet weights, a TensorFile.
  /// @throws MissingInputError, InputError.
  FeatureTeacher(const std::filesystem::path& weights, torch::Device device);

  /// @param srgb  [B, 3, H, W] 0..1.  @return  [B, 512, rows, columns] f32, averaged to that size.
  [[nodiscard]] torch::Tensor features(const torch::Tensor& srgb, std::int64_t rows, std::int64_t columns) const;

 private:
  [[nodiscard]] const torch::Tensor& at(const std::string& name) const;
  [[nodiscard]] torch::Tensor fire(const torch::Tensor& x, const std::string& name) const;

  TensorFile file_;
  torch::Device device_;
  mutable std::map<std::string, torch::Tensor> weights_;  // those of `file_` that were used, on the device
};

}  // namespace cnerf::colorizer_training
