// Losses of pictures by LibTorch: see picture_loss.h.

#include <torch/script.h>
#include <torch/torch.h>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/tensor_file.h"
#include "src/compare/baselines/torch/style_math.h"
#include "src/compare/baselines/torch_plugin.h"

namespace cnerf::compare {
namespace fs = std::filesystem;
namespace {
using torch::Tensor;

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

/// What both losses share: a picture goes in, and the derivative by its ab comes out.
class TorchLoss : public PictureLoss {
 public:
  [[nodiscard]] double operator()(const LabPicture& picture, std::span<float> gradient) const final {
    CNERF_CHECK_EQ(gradient.size(), picture.ab.size());
    CNERF_CHECK(std::min(picture.width, picture.height) >= kLeastSide, "pictures of at least 32 x 32 pixels");
    const Tensor ab = image(picture.ab, {2, picture.height, picture.width}).requires_grad_(true);
    const Tensor loss = of(style::srgb(image(picture.lightness, {picture.height, picture.width}), ab));
    const Tensor host = torch::autograd::grad({loss}, {ab})[0].to(torch::kCPU).contiguous();
    std::copy_n(host.data_ptr<float>(), gradient.size(), gradient.begin());
    return loss.item<double>();
  }

 private:
  /// @param srgb  [1, 3, H, W]
  [[nodiscard]] virtual Tensor of(const Tensor& srgb) const = 0;
};

class StyleLoss final : public TorchLoss {
 public:
  StyleLoss(const fs::path& weights, const LabPicture& reference) : features_(alexnet_file(weights)) {
    if (std::min(reference.width, reference.height) < kLeastSide) {
      throw InputError(weights, "reference", "style transfer needs a reference of at least 32 x 32 pixels");
    }
    const torch::NoGradGuard no_gradient;
    reference_ = vectors(style::srgb(image(reference.lightness, {reference.height, reference.width}),
                                     image(reference.ab, {2, reference.height, reference.width})));
  }

 private:
  [[nodiscard]] Tensor of(const Tensor& srgb) const override {
    const auto layers = vectors(srgb);
    Tensor loss = torch::zeros({}, srgb.options().requires_grad(false));
    for (std::size_t i = 0; i < layers.size(); ++i) {
      loss = loss + style::nearest_neighbour_loss(layers[i], reference_[i]);
    }
    return loss;
  }
  [[nodiscard]] std::vector<Tensor> vectors(const Tensor& srgb) const {
    std::vector<Tensor> all;
    for (const Tensor& layer : features_(srgb)) all.push_back(style::unit_vectors(layer));
    return all;
  }

  AlexNet features_;
  std::vector<Tensor> reference_;  // unit vectors of each layer
};

constexpr std::int64_t kClipSide = 224;  // pixels that CLIP's encoders are shown
// Of CLIP's training (Radford et al. 2021, its published code).
constexpr std::array<float, 3> kClipMean = {0.48145466f, 0.4578275f, 0.40821073f};
constexpr std::array<float, 3> kClipDeviation = {0.26862954f, 0.26130258f, 0.27577711f};

/// What a user's network makes of an input, [D].  @throws InputError  naming its file.
Tensor encoded(const fs::path& file, torch::jit::Module network, const torch::IValue& input) {
  try {
    return network.forward({input}).toTensor().to(device(), torch::kFloat32).flatten();
  } catch (const std::exception& error) {
    const std::string text = error.what();
    throw InputError(file, "network",
                     "no encoder that works here: " + text.substr(text.rfind('\n', text.size() - 2) + 1));
  }
}

/// @throws MissingInputError, InputError
torch::jit::Module network_in(const fs::path& file) {
  if (!fs::exists(file)) throw MissingInputError(file.string() + ": no such file");
  try {
    torch::jit::Module network = torch::jit::load(file.string(), device());
    network.eval();
    return network;
  } catch (const std::exception&) {
    throw InputError(file, "network", "not a TorchScript module that LibTorch can load");
  }
}

class TextLoss final : public TorchLoss {
 public:
  explicit TextLoss(const TextGuide& guide)
      : file_(guide.image_encoder),
        network_(network_in(file_)),
        text_(encoded(guide.text_encoder, network_in(guide.text_encoder), guide.text).detach()),
        mean_(image({kClipMean.begin(), kClipMean.end()}, {1, 3, 1, 1})),
        deviation_(image({kClipDeviation.begin(), kClipDeviation.end()}, {1, 3, 1, 1})) {
    const std::int64_t count = encoded(file_, network_, torch::zeros({1, 3, kClipSide, kClipSide}, device())).numel();
    if (count != text_.numel()) {
      throw InputError(file_, "output",
                       "expected " + std::to_string(text_.numel()) + " numbers, as the text encoder has, got " +
                           std::to_string(count));
    }
  }

 private:
  [[nodiscard]] Tensor of(const Tensor& srgb) const override {
    namespace F = torch::nn::functional;
    const auto squeezed = F::InterpolateFuncOptions()
                              .size(std::vector<std::int64_t>{kClipSide, kClipSide})
                              .mode(torch::kBicubic)
                              .align_corners(false)
                              .antialias(true);
    const Tensor shown = (F::interpolate(srgb, squeezed) - mean_) / deviation_;
    return 1 - torch::cosine_similarity(encoded(file_, network_, shown), text_, 0);
  }

  fs::path file_;
  torch::jit::Module network_;
  Tensor text_, mean_, deviation_;
};

}  // namespace

std::unique_ptr<PictureLoss> make_torch_style_loss(const fs::path& weights, const LabPicture& reference) {
  return std::make_unique<StyleLoss>(weights, reference);
}

std::unique_ptr<PictureLoss> make_torch_text_loss(const TextGuide& guide) {
  return std::make_unique<TextLoss>(guide);
}

}  // namespace cnerf::compare
