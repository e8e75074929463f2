#include "src/colorizer/torch/encoder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/colorizer/torch/lab_tensors.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;
using torch::Tensor;

constexpr std::array<int, Encoder::kStages> kBlocks{3, 4, 6, 3};
constexpr std::int64_t kExpansion = 4;
/// What the training subtracted, of 0..255: blue, green, red.
constexpr std::array<float, 3> kMeans{103.939f, 116.779f, 123.68f};

constexpr int kShownSide = 224;  // pixels of the shorter side of a picture in colour, as the training's

/// Planes of blue, green and red, 0..255, as the encoder's training had pictures.  [B, 3, H, W]
Tensor normalised(std::vector<Tensor> planes) {
  for (std::size_t i = 0; i < planes.size(); ++i) planes[i] = planes[i] - kMeans[i];
  return torch::cat(planes, 1).contiguous(at::MemoryFormat::ChannelsLast);
}

/// A grey picture as such.
Tensor input_of(const Tensor& lightness) {
  const Tensor grey = 255 * srgb_from_lightness(lightness);
  return normalised({grey, grey, grey});
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

Encoder Encoder::on(torch::Device device) const {
  Encoder moved = *this;
  const auto move = [device](FoldedConv& conv) {
    conv.weight = conv.weight.to(device);
    conv.bias = conv.bias.to(device);
  };
  move(moved.stem_);
  for (std::vector<Block>& blocks : moved.stages_) {
    for (Block& block : blocks) {
      for (FoldedConv* conv : {&block.reduce, &block.middle, &block.expand}) move(*conv);
      if (block.shortcut) move(*block.shortcut);
    }
  }
  return moved;
}

std::vector<Tensor> Encoder::features(const Tensor& lightness) const {
  CNERF_CHECK(lightness.size(2) % kInputMultiple == 0 && lightness.size(3) % kInputMultiple == 0,
              "sides are multiples of the encoder's");
  return stages_of(input_of(lightness));
}

std::vector<Tensor> Encoder::stages_of(const Tensor& picture) const {
  const torch::NoGradGuard no_grad;
  Tensor x = torch::max_pool2d(stem_(picture).relu_(), 3, 2, 1);
  std::vector<Tensor> all;
  for (const std::vector<Block>& blocks : stages_) {
    for (const Block& block : blocks) x = block(x);
    all.push_back(x);
  }
  return all;
}

std::vector<float> Encoder::regions(std::span<const std::uint8_t> rgb, int width, int height) const {
  CNERF_CHECK_EQ(rgb.size(), std::size_t(width) * std::size_t(height) * 3);
  namespace F = torch::nn::functional;
  const auto bytes = const_cast<std::uint8_t*>(rgb.data());
  Tensor picture =
      torch::from_blob(bytes, {1, height, width, 3}, torch::kUInt8).to(torch::kFloat).permute({0, 3, 1, 2});
  const auto shown = [&](int side) {
    const double scaled = double(side) * kShownSide / std::min(width, height);
    return kInputMultiple * std::max<std::int64_t>(1, std::llround(scaled / kInputMultiple));
  };
  picture = F::interpolate(picture, F::InterpolateFuncOptions()
                                        .size(std::vector<std::int64_t>{shown(height), shown(width)})
                                        .mode(torch::kBilinear)
                                        .align_corners(false)
                                        .antialias(true));
  const auto plane = [&](std::int64_t channel) { return picture.slice(1, channel, channel + 1); };
  const Tensor last = stages_of(normalised({plane(2), plane(1), plane(0)})).back();
  const Tensor pooled = torch::adaptive_avg_pool2d(last, {kRegions, kRegions})[0].flatten(1).t().contiguous();
  return {pooled.data_ptr<float>(), pooled.data_ptr<float>() + pooled.numel()};
}

std::unique_ptr<PictureEncoder> make_torch_picture_encoder() {
  return std::make_unique<Encoder>(read_layers_model(encoder_folder()));
}

std::shared_ptr<const Encoder> load_encoder(const fs::path& folder) {
  return std::make_shared<const Encoder>(read_layers_model(folder));
}

std::shared_ptr<const Encoder> installed_encoder(const std::string& what) {
  if (!is_encoder_installed()) {
    throw MissingInputError(what + ": needs the encoder, which is not in " + encoder_folder().string() +
                            "; scripts/install_dependencies.sh --encoder installs it");
  }
  return load_encoder(encoder_folder());
}

}  // namespace cnerf
