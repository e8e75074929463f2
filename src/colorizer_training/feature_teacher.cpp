#include "src/colorizer_training/feature_teacher.h"

#include <vector>

namespace cnerf::colorizer_training {
namespace fs = std::filesystem;
namespace F = torch::nn::functional;
using torch::Tensor;

namespace {

constexpr std::int64_t kInputSide = 192;  // small pictures are enlarged: the classifier knows 224 pixels

}  // namespace

FeatureTeacher::FeatureTeacher(const fs::path& weights, torch::Device device) : file_(weights), device_(device) {}

const Tensor& FeatureTeacher::at(const std::string& name) const {
  const auto known = weights_.find(name);
  if (known != weights_.end()) return known->second;
  const TensorFile::Tensor& tensor = file_.get(name);
  const std::vector<std::int64_t> shape(tensor.shape.begin(), tensor.shape.end());
  const Tensor values = torch::from_blob(const_cast<float*>(tensor.values.data()), shape);
  return weights_[name] = values.to(device_, values.scalar_type(), /*non_blocking=*/false, /*copy=*/true);
}

Tensor FeatureTeacher::fire(const Tensor& x, const std::string& name) const {
  const std::string base = "core.net." + name + ".";
  const auto layer = [&](const Tensor& in, const std::string& part, std::int64_t padding) {
    return torch::relu(torch::conv2d(in, at(base + part + ".weight"), at(base + part + ".bias"), 1, padding));
  };
  const Tensor squeezed = layer(x, "squeeze", 0);
  return torch::cat({layer(squeezed, "expand1x1", 0), layer(squeezed, "expand3x3", 1)}, 1);
}

Tensor FeatureTeacher::features(const Tensor& srgb, std::int64_t rows, std::int64_t columns) const {
  const torch::NoGradGuard no_grad;
  const auto pool = [](const Tensor& in) { return torch::max_pool2d(in, 3, 2, 0, 1, /*ceil_mode=*/true); };
  Tensor x = F::interpolate(srgb, F::InterpolateFuncOptions()
                                      .size(std::vector<std::int64_t>{kInputSide, kInputSide})
                                      .mode(torch::kBilinear)
                                      .align_corners(false));
  x = (2 * x - 1 - at("core.scaling_layer.shift")) / at("core.scaling_layer.scale");
  x = torch::relu(torch::conv2d(x.contiguous(torch::MemoryFormat::ChannelsLast), at("core.net.slice1.0.weight"),
                                at("core.net.slice1.0.bias"), 2));
  x = fire(fire(pool(x), "slice2.3"), "slice2.4");
  x = fire(fire(pool(x), "slice3.6"), "slice3.7");
  x = fire(pool(x), "slice4.9");
  x = fire(x, "slice5.10");
  x = fire(x, "slice6.11");
  x = fire(x, "slice7.12");
  return torch::adaptive_avg_pool2d(x.to(torch::kFloat32), {rows, columns});
}

}  // namespace cnerf::colorizer_training
