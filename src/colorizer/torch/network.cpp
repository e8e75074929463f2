#include "src/colorizer/torch/network.h"

#include <array>
#include <string>
#include <utility>

#include "src/base/check.h"
#include "src/color/ab_bins.h"
#include "src/colorizer/torch/encoder.h"

namespace cnerf {
namespace nn = torch::nn;
namespace F = torch::nn::functional;
using torch::Tensor;

namespace {

constexpr double kDropPath = 0.1;
constexpr double kDropout = 0.1;
constexpr std::int64_t kHeads = 8;
constexpr std::array<std::int64_t, 5> kChannels = {32, 64, 128, 216, 256};  // at 1/2, 1/4, ... 1/32
constexpr std::int64_t kQuarterChannels = 128;                              // of the decoder's last stage

/// Stochastic depth (Huang et al. 2016): a sample's branch is kept and scaled, or left out.
Tensor drop_path(const Tensor& branch, double probability, bool training) {
  if (!training || probability == 0) return branch;
  const double keep = 1 - probability;
  std::vector<std::int64_t> shape(std::size_t(branch.dim()), 1);
  shape[0] = branch.size(0);
  return branch * torch::empty(shape, branch.options()).bernoulli_(keep).div_(keep);
}

Tensor upsample_to(const Tensor& x, const Tensor& like) {
  return F::interpolate(x, F::InterpolateFuncOptions()
                               .size(std::vector<std::int64_t>{like.size(2), like.size(3)})
                               .mode(torch::kBilinear)
                               .align_corners(false));
}

nn::Sequential residual_units(int count, std::int64_t channels, double drop, Normalisation normalisation) {
  nn::Sequential units;
  for (int i = 0; i < count; ++i) units->push_back(ResidualUnit(channels, drop, normalisation));
  return units;
}

}  // namespace

ConvUnitImpl::ConvUnitImpl(std::int64_t in, std::int64_t out, std::int64_t kernel, std::int64_t stride, bool relu,
                           Normalisation normalisation)
    : relu_(relu) {
  const bool folded = normalisation == Normalisation::kFolded;
  conv_ = register_module(
      "conv", nn::Conv2d(nn::Conv2dOptions(in, out, kernel).stride(stride).padding(kernel / 2).bias(folded)));
  if (!folded) norm_ = register_module("norm", nn::BatchNorm2d(out));
}

Tensor ConvUnitImpl::forward(const Tensor& x) {
  Tensor y = conv_->forward(x);
  if (norm_) y = norm_->forward(y);
  return relu_ ? torch::relu_(y) : y;
}

void ConvUnitImpl::fold_from(const ConvUnitImpl& trained) {
  CNERF_CHECK(norm_.is_empty() && !trained.norm_.is_empty(), "folds a trained unit into a folded one");
  const torch::NoGradGuard no_grad;
  const auto& norm = *trained.norm_;
  const Tensor scale = norm.weight / torch::sqrt(norm.running_var + norm.options.eps());
  conv_->weight.copy_(trained.conv_->weight * scale.view({-1, 1, 1, 1}));
  conv_->bias.copy_(norm.bias - norm.running_mean * scale);
}

ResidualUnitImpl::ResidualUnitImpl(std::int64_t channels, double drop, Normalisation normalisation) : drop_path_(drop) {
  first_ = register_module("first", ConvUnit(channels, channels, 3, 1, true, normalisation));
  second_ = register_module("second", ConvUnit(channels, channels, 3, 1, false, normalisation));
}

Tensor ResidualUnitImpl::forward(const Tensor& x) {
  return torch::relu(x + drop_path(second_->forward(first_->forward(x)), drop_path_, is_training()));
}

AttentionUnitImpl::AttentionUnitImpl(std::int64_t channels, std::int64_t heads, double drop)
    : heads_(heads), drop_path_(drop) {
  position_ =
      register_module("position", nn::Conv2d(nn::Conv2dOptions(channels, channels, 3).padding(1).groups(channels)));
  attention_norm_ = register_module("attention_norm", nn::LayerNorm(nn::LayerNormOptions({channels})));
  mlp_norm_ = register_module("mlp_norm", nn::LayerNorm(nn::LayerNormOptions({channels})));
  qkv_ = register_module("qkv", nn::Linear(channels, 3 * channels));
  projection_ = register_module("projection", nn::Linear(channels, channels));
  expand_ = register_module("expand", nn::Linear(channels, 2 * channels));
  contract_ = register_module("contract", nn::Linear(2 * channels, channels));
}

Tensor AttentionUnitImpl::attend(const Tensor& tokens) {
  const std::int64_t batch = tokens.size(0), count = tokens.size(1), channels = tokens.size(2);
  const std::int64_t width = channels / heads_;
  const Tensor qkv = qkv_->forward(tokens).view({batch, count, 3, heads_, width}).permute({2, 0, 3, 1, 4});
  const Tensor scores = torch::matmul(qkv[0], qkv[1].transpose(-2, -1)) / std::sqrt(double(width));
  const Tensor mixed = torch::matmul(torch::softmax(scores, -1), qkv[2]);  // [B, heads, N, width]
  return projection_->forward(mixed.transpose(1, 2).reshape({batch, count, channels}));
}

Tensor AttentionUnitImpl::forward(const Tensor& x) {
  const Tensor placed = x + position_->forward(x);
  Tensor tokens = placed.flatten(2).transpose(1, 2);  // [B, N, C]
  tokens = tokens + drop_path(attend(attention_norm_->forward(tokens)), drop_path_, is_training());
  const Tensor hidden = torch::gelu(expand_->forward(mlp_norm_->forward(tokens)));
  tokens = tokens + drop_path(contract_->forward(hidden), drop_path_, is_training());
  return tokens.transpose(1, 2).reshape(x.sizes()).contiguous(x.suggest_memory_format());
}

ColorizerNetImpl::ColorizerNetImpl(Normalisation n, std::shared_ptr<const Encoder> encoder)
    : encoder_(std::move(encoder)) {
  const auto [c2, c4, c8, c16, c32] = kChannels;
  stem_ = register_module("stem", ConvUnit(1, c2, 3, 2, true, n));
  encode2_ = register_module("encode2", residual_units(1, c2, 0, n));
  down4_ = register_module("down4", ConvUnit(c2, c4, 3, 2, true, n));
  encode4_ = register_module("encode4", residual_units(2, c4, 0, n));
  down8_ = register_module("down8", ConvUnit(c4, c8, 3, 2, true, n));
  encode8_ = register_module("encode8", residual_units(2, c8, 0.5 * kDropPath, n));
  down16_ = register_module("down16", ConvUnit(c8, c16, 3, 2, true, n));
  encode16_ = register_module("encode16", residual_units(1, c16, kDropPath, n));
  down32_ = register_module("down32", ConvUnit(c16, c32, 3, 2, true, n));
  encode32_ = register_module("encode32", residual_units(1, c32, kDropPath, n));
  attention0_ = register_module("attention0", AttentionUnit(c32, kHeads, kDropPath));
  attention1_ = register_module("attention1", AttentionUnit(c32, kHeads, kDropPath));
  global_ = register_module("global", nn::Linear(c32, c32));
  join16_ = register_module("join16", ConvUnit(c32 + c16, c16, 1, 1, true, n));
  decode16_ = register_module("decode16", residual_units(1, c16, kDropPath, n));
  join8_ = register_module("join8", ConvUnit(c16 + c8, c8, 1, 1, true, n));
  decode8_ = register_module("decode8", residual_units(1, c8, 0.5 * kDropPath, n));
  join4_ = register_module("join4", ConvUnit(c8 + c4, kQuarterChannels, 1, 1, true, n));
  decode4_ = register_module("decode4", residual_units(1, kQuarterChannels, 0, n));
  dropout_ = register_module("dropout", nn::Dropout(kDropout));
  classify_ = register_module("classify", nn::Conv2d(nn::Conv2dOptions(kQuarterChannels, kAbBinCount, 1)));
  if (encoder_ == nullptr) return;
  const std::vector<std::int64_t>& seen = encoder_->channels();
  see4_ = register_module("see4", ConvUnit(seen.at(0), c4, 1, 1, false, n));
  see8_ = register_module("see8", ConvUnit(seen.at(1), c8, 1, 1, false, n));
  see16_ = register_module("see16", ConvUnit(seen.at(2), c16, 1, 1, false, n));
  see32_ = register_module("see32", ConvUnit(seen.at(3), c32, 1, 1, false, n));
}

void ColorizerNetImpl::to(torch::Device device, bool non_blocking) {
  Module::to(device, non_blocking);
  if (encoder_ && encoder_->device() != device) encoder_ = std::make_shared<const Encoder>(encoder_->on(device));
}

Tensor ColorizerNetImpl::forward(const Tensor& lightness) {
  return features(lightness).logits;
}

Tensor ColorizerNetImpl::bottleneck(const Tensor& at32) {
  return attention1_->forward(attention0_->forward(encode32_->forward(at32)));
}

ColorizerFeatures ColorizerNetImpl::features(const Tensor& lightness) {
  CNERF_CHECK(lightness.dim() == 4 && lightness.size(1) == 1, "lightness is [B, 1, H, W]");
  CNERF_CHECK(lightness.size(2) % kInputMultiple == 0 && lightness.size(3) % kInputMultiple == 0,
              "sides are multiples of the network's");
  const torch::ScalarType type = classify_->weight.scalar_type();
  const Tensor input = (lightness / 50 - 1).to(type).contiguous(torch::MemoryFormat::ChannelsLast);
  const std::vector<Tensor> seen = encoder_ ? encoder_->features(lightness) : std::vector<Tensor>();
  const auto with_seen = [&](const Tensor& x, ConvUnit& see, std::size_t stage) {
    return encoder_ ? x + see->forward(type == torch::kFloat32 ? seen[stage] : seen[stage].to(type)) : x;
  };

  const Tensor at2 = encode2_->forward(stem_->forward(input));
  const Tensor at4 = encode4_->forward(with_seen(down4_->forward(at2), see4_, 0));
  const Tensor at8 = encode8_->forward(with_seen(down8_->forward(at4), see8_, 1));
  const Tensor at16 = encode16_->forward(with_seen(down16_->forward(at8), see16_, 2));
  const Tensor at32 = bottleneck(with_seen(down32_->forward(at16), see32_, 3));

  const Tensor global = at32.mean({2, 3});
  const Tensor informed = at32 + global_->forward(global).unsqueeze(-1).unsqueeze(-1);
  const Tensor up16 = decode16_->forward(join16_->forward(torch::cat({upsample_to(informed, at16), at16}, 1)));
  const Tensor up8 = decode8_->forward(join8_->forward(torch::cat({upsample_to(up16, at8), at8}, 1)));
  const Tensor up4 = decode4_->forward(join4_->forward(torch::cat({upsample_to(up8, at4), at4}, 1)));
  return {classify_->forward(dropout_->forward(up4)), up16, global};
}

void ColorizerNetImpl::shift_logits(const Tensor& offsets) {
  const torch::NoGradGuard no_grad;
  classify_->bias.add_(offsets.to(classify_->bias.device()));
}

ColorizerNet fold_batch_norm(const ColorizerNet& trained) {
  const torch::NoGradGuard no_grad;
  ColorizerNet folded(Normalisation::kFolded, trained->encoder());
  const auto parameters = trained->named_parameters();
  for (auto& item : folded->named_parameters()) {
    if (const Tensor* source = parameters.find(item.key())) item.value().copy_(*source);
  }
  const auto modules = trained->named_modules();
  for (auto& item : folded->named_modules()) {
    auto* unit = item.value()->as<ConvUnitImpl>();
    const auto* source = modules[item.key()]->as<ConvUnitImpl>();
    if (unit && source->is_normalised()) unit->fold_from(*source);
  }
  folded->to(trained->parameters().front().device());
  folded->eval();
  return folded;
}

std::int64_t parameter_count(const nn::Module& module) {
  std::int64_t count = 0;
  for (const Tensor& parameter : module.parameters()) count += parameter.numel();
  return count;
}

}  // namespace cnerf
