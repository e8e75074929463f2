#include "src/colorizer/torch/encoder.h"

#include <array>
#include <cstdlib>
#include <cstring>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/color/colorspace_math.h"
#include "src/colorizer/torch/reference_network.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;
using torch::Tensor;

constexpr std::array<int, Encoder::kStages> kBlocks{3, 4, 6, 3};
constexpr std::int64_t kExpansion = 4;
/// What the training subtracted, of 0..255: blue, green, red.
constexpr std::array<float, 3> kMeans{103.939f, 116.779f, 123.68f};

/// A grey picture as the encoder's training had pictures.  [B, 3, H, W]
Tensor input_of(const Tensor& lightness) {
  const Tensor source = lightness.contiguous();
  Tensor grey = torch::empty_like(source);
  const float* from = source.data_ptr<float>();
  float* to = grey.data_ptr<float>();
  for (std::int64_t i = 0; i < source.numel(); ++i) to[i] = 255 * srgb_from_linear(luminance_from_lightness(from[i]));
  std::vector<Tensor> planes;
  for (const float mean : kMeans) planes.push_back(grey - mean);
  return torch::cat(planes, 1).contiguous(at::MemoryFormat::ChannelsLast);
}

}  // namespace

Tensor tensor_of(const LayersModel& model, const std::string& name, const std::vector<std::int64_t>& shape) {
  const LayersModel::Weight& weight = model.weight(name, shape);
  Tensor values = torch::empty(shape);
  std::memcpy(values.data_ptr<float>(), weight.floats.data(), weight.floats.size());
  return values;
}

FoldedConv folded_conv(const LayersModel& model, const std::string& conv, const std::string& norm,
                       const std::vector<std::int64_t>& shape) {
  const std::vector<std::int64_t> out{shape[3]};
  const auto of_norm = [&](const char* name) { return tensor_of(model, norm + "/" + name, out).to(torch::kDouble); };
  const Tensor variance = of_norm("moving_variance");
  if ((variance < 0).any().item<bool>()) {
    throw InputError(model.file, norm + "/moving_variance", "expected no negative numbers, found one");
  }
  // In double precision once, instead of rounding twice.
  const Tensor scale = of_norm("gamma") / (variance + model.epsilon_of(norm)).sqrt();
  const Tensor kernel = tensor_of(model, conv + "/kernel", shape).permute({3, 2, 0, 1}).to(torch::kDouble);
  const Tensor bias = tensor_of(model, conv + "/bias", out).to(torch::kDouble);
  return {(kernel * scale.view({-1, 1, 1, 1})).to(torch::kFloat).contiguous(at::MemoryFormat::ChannelsLast),
          ((bias - of_norm("moving_mean")) * scale + of_norm("beta")).to(torch::kFloat)};
}

Tensor FoldedConv::operator()(const Tensor& x) const {
  return torch::conv2d(x, weight, bias, stride, weight.size(2) / 2);
}

Tensor Encoder::Block::operator()(const Tensor& x) const {
  const Tensor inner = middle(reduce(x).relu_()).relu_();
  return expand(inner).add_(shortcut ? (*shortcut)(x) : x).relu_();
}

Encoder::Block Encoder::block(const LayersModel& model, const std::string& name, std::int64_t in, std::int64_t width,
                              std::int64_t stride) {
  const auto conv = [&](const std::string& branch, const std::vector<std::int64_t>& shape) {
    return folded_conv(model, "res" + name + "_branch" + branch, "bn" + name + "_branch" + branch, shape);
  };
  const std::int64_t out = width * kExpansion;
  Block made{conv("2a", {1, 1, in, width}), conv("2b", {3, 3, width, width}), conv("2c", {1, 1, width, out}),
             std::nullopt};
  made.reduce.stride = stride;
  if (name.back() == 'a') {
    made.shortcut = conv("1", {1, 1, in, out});
    made.shortcut->stride = stride;
  }
  return made;
}

Encoder::Encoder(const LayersModel& model) : sha256_(model.sha256) {
  const torch::NoGradGuard no_grad;
  const auto first = model.weights.find("conv1/kernel");
  const std::int64_t filters = first == model.weights.end() ? 64 : first->second.shape.back();
  stem_ = folded_conv(model, "conv1", "bn_conv1", {7, 7, 3, filters});
  stem_.stride = 2;
  std::int64_t in = filters;
  for (std::size_t stage = 0; stage < kStages; ++stage) {
    const std::int64_t width = filters << stage;
    std::vector<Block>& blocks = stages_.emplace_back();
    for (int i = 0; i < kBlocks[stage]; ++i) {
      const std::string name = std::to_string(stage + 2) + char('a' + i);
      blocks.push_back(block(model, name, in, width, i == 0 && stage > 0 ? 2 : 1));
      in = width * kExpansion;
    }
    channels_.push_back(in);
  }
}

std::vector<Tensor> Encoder::features(const Tensor& lightness) const {
  CNERF_CHECK(lightness.size(2) % kInputMultiple == 0 && lightness.size(3) % kInputMultiple == 0,
              "sides are multiples of the encoder's");
  const torch::NoGradGuard no_grad;
  Tensor x = torch::max_pool2d(stem_(input_of(lightness)).relu_(), 3, 2, 1);
  std::vector<Tensor> all;
  for (const std::vector<Block>& blocks : stages_) {
    for (const Block& block : blocks) x = block(x);
    all.push_back(x);
  }
  return all;
}

std::shared_ptr<const Encoder> load_encoder(const fs::path& folder) {
  return std::make_shared<const Encoder>(read_layers_model(folder));
}

fs::path encoder_folder() {
  if (const char* named = std::getenv("CNERF_ENCODER")) return named;
  if (const char* data = std::getenv("XDG_DATA_HOME"); data != nullptr && *data != '\0') {
    return fs::path(data) / "cnerf" / "encoder";
  }
  const char* home = std::getenv("HOME");
  return home == nullptr ? fs::path() : fs::path(home) / ".local" / "share" / "cnerf" / "encoder";
}

bool is_encoder_installed() {
  const fs::path folder = encoder_folder();
  return !folder.empty() && fs::exists(folder / "model.json");
}

}  // namespace cnerf
