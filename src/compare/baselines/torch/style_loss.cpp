// ARF's style loss by LibTorch: see style_loss.h.

#include <torch/torch.h>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/tensor_file.h"
#include "src/compare/baselines/torch/style_math.h"
#include "src/compare/baselines/torch_plugin.h"

namespace cnerf::compare {
namespace fs = std::filesystem;
namespace {

torch::Device device() {
  return torch::cuda::is_available() ? torch::kCUDA : torch::kCPU;
}

torch::Tensor image(const std::vector<float>& values, torch::IntArrayRef shape) {
  return torch::from_blob(const_cast<float*>(values.data()), shape, torch::kFloat32).clone().to(device());
}

/// AlexNet up to its third convolution.
class AlexNet {
 public:
  explicit AlexNet(const TensorFile& file) {
    for (const char* name : {"conv1", "conv2", "conv3"}) {
      for (const char* part : {".weight", ".bias"}) {
        const TensorFile::Tensor& tensor = file.get(std::string(name) + part);
        const std::vector<std::int64_t> shape(tensor.shape.begin(), tensor.shape.end());
        parameters_.push_back(image({tensor.values.begin(), tensor.values.end()}, shape));
      }
    }
    // Of LPIPS's scaling layer, which takes values in -1..1.
    shift_ = torch::tensor({-0.030f, -0.088f, -0.188f}).view({1, 3, 1, 1}).to(device());
    scale_ = torch::tensor({0.458f, 0.448f, 0.450f}).view({1, 3, 1, 1}).to(device());
  }

  [[nodiscard]] std::vector<torch::Tensor> operator()(const torch::Tensor& srgb) const {
    const auto layer = [&](const torch::Tensor& x, std::size_t index, std::int64_t stride, std::int64_t padding) {
      return torch::relu(torch::conv2d(x, parameters_[2 * index], parameters_[2 * index + 1], stride, padding));
    };
    const torch::Tensor first = layer((2 * srgb - 1 - shift_) / scale_, 0, 4, 2);
    const torch::Tensor second = layer(torch::max_pool2d(first, 3, 2), 1, 1, 2);
    return {second, layer(torch::max_pool2d(second, 3, 2), 2, 1, 1)};
  }

 private:
  std::vector<torch::Tensor> parameters_;
  torch::Tensor shift_, scale_;
};

/// AlexNet's weights.  @throws MissingInputError, InputError
TensorFile alexnet_file(const fs::path& weights) {
  if (!fs::exists(weights)) throw MissingInputError(weights.string() + ": no such file");
  TensorFile file(weights);
  if (!file.has("conv1.weight")) {
    throw InputError(weights, "conv1.weight", "no such tensor; of the LPIPS networks, style transfer takes AlexNet");
  }
  return file;
}

class TorchStyleLoss final : public StyleLoss {
 public:
  TorchStyleLoss(const fs::path& weights, const LabPicture& reference) : features_(alexnet_file(weights)) {
    if (std::min(reference.width, reference.height) < kLeastSide) {
      throw InputError(weights, "reference", "style transfer needs a reference of at least 32 x 32 pixels");
    }
    const torch::NoGradGuard no_gradient;
    reference_ = vectors(style::srgb(image(reference.lightness, {reference.height, reference.width}),
                                     image(reference.ab, {2, reference.height, reference.width})));
  }

  [[nodiscard]] double operator()(const LabPicture& picture, std::span<float> gradient) const override {
    CNERF_CHECK_EQ(gradient.size(), picture.ab.size());
    CNERF_CHECK(std::min(picture.width, picture.height) >= kLeastSide, "pictures of at least 32 x 32 pixels");
    torch::Tensor ab = image(picture.ab, {2, picture.height, picture.width}).requires_grad_(true);
    const auto layers = vectors(style::srgb(image(picture.lightness, {picture.height, picture.width}), ab));
    torch::Tensor loss = torch::zeros({}, ab.options().requires_grad(false));
    for (std::size_t i = 0; i < layers.size(); ++i) {
      loss = loss + style::nearest_neighbour_loss(layers[i], reference_[i]);
    }
    loss.backward();
    const torch::Tensor host = ab.grad().to(torch::kCPU).contiguous();
    std::copy_n(host.data_ptr<float>(), gradient.size(), gradient.begin());
    return loss.item<double>();
  }

 private:
  [[nodiscard]] std::vector<torch::Tensor> vectors(const torch::Tensor& srgb) const {
    std::vector<torch::Tensor> all;
    for (const torch::Tensor& layer : features_(srgb)) all.push_back(style::unit_vectors(layer));
    return all;
  }

  AlexNet features_;
  std::vector<torch::Tensor> reference_;  // unit vectors of each layer
};

}  // namespace

std::unique_ptr<StyleLoss> make_torch_style_loss(const fs::path& weights, const LabPicture& reference) {
  return std::make_unique<TorchStyleLoss>(weights, reference);
}

}  // namespace cnerf::compare
