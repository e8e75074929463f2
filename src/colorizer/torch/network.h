#pragma once
/// The built-in colorizer's network: a residual U-Net that classifies each 4x4 block into the 313 ab bins.

#include <torch/torch.h>

#include <cstdint>
#include <memory>

namespace cnerf {

class Encoder;  // encoder.h

/// Training uses batch normalisation; exported networks carry it folded into the convolutions.
enum class Normalisation { kBatch, kFolded };

/// 3x3 convolution, normalisation, optional ReLU.
class ConvUnitImpl : public torch::nn::Module {
 public:
  ConvUnitImpl(std::int64_t in, std::int64_t out, std::int64_t kernel, std::int64_t stride, bool relu,
               Normalisation normalisation);
  torch::Tensor forward(const torch::Tensor& x);
  /// Takes over the convolution of `trained` with its batch normalisation multiplied in. Of a folded unit only.
  void fold_from(const ConvUnitImpl& trained);
  [[nodiscard]] bool is_normalised() const { return !norm_.is_empty(); }

 private:
  torch::nn::Conv2d conv_{nullptr};
  torch::nn::BatchNorm2d norm_{nullptr};  ///< empty when folded
  bool relu_;
};
TORCH_MODULE(ConvUnit);

/// relu(x + conv(relu(conv(x)))); in training the branch is dropped for a whole sample with probability `drop_path`.
class ResidualUnitImpl : public torch::nn::Module {
 public:
  ResidualUnitImpl(std::int64_t channels, double drop_path, Normalisation normalisation);
  torch::Tensor forward(const torch::Tensor& x);

 private:
  ConvUnit first_{nullptr}, second_{nullptr};
  double drop_path_;
};
TORCH_MODULE(ResidualUnit);

/// Pre-norm transformer block over all positions of a feature map, with a depthwise convolution as position code.
class AttentionUnitImpl : public torch::nn::Module {
 public:
  AttentionUnitImpl(std::int64_t channels, std::int64_t heads, double drop_path);
  torch::Tensor forward(const torch::Tensor& x);

 private:
  [[nodiscard]] torch::Tensor attend(const torch::Tensor& tokens);

  torch::nn::Conv2d position_{nullptr};
  torch::nn::LayerNorm attention_norm_{nullptr}, mlp_norm_{nullptr};
  torch::nn::Linear qkv_{nullptr}, projection_{nullptr}, expand_{nullptr}, contract_{nullptr};
  std::int64_t heads_;
  double drop_path_;
};
TORCH_MODULE(AttentionUnit);

/// What the network knows about a batch: the answer, and inner features that training hangs auxiliary losses on.
struct ColorizerFeatures {
  torch::Tensor logits;    ///< [B, 313, H/4, W/4]
  torch::Tensor semantic;  ///< [B, kSemanticChannels, H/16, W/16], after the bottleneck
  torch::Tensor global;    ///< [B, kGlobalChannels] average of the bottleneck
};

/// Lightness in, logits over the 313 bins at quarter resolution out.
/// Strides 2 to 1/32 with 32, 64, 128, 216, 256 channels; two attention units and a global average at the bottleneck.
/// The large network has a frozen encoder beside it: what that sees at 1/4 to 1/32 is added on the way down.
class ColorizerNetImpl : public torch::nn::Module {
 public:
  static constexpr std::int64_t kSemanticChannels = 216;
  static constexpr std::int64_t kGlobalChannels = 256;
  static constexpr std::int64_t kInputMultiple = 32;  ///< of both sides, pixels

  /// @param encoder  of the large network; null = the small one
  explicit ColorizerNetImpl(Normalisation normalisation = Normalisation::kBatch,
                            std::shared_ptr<const Encoder> encoder = nullptr);

  /// @param lightness  [B, 1, H, W] f32, L* 0..100; H and W are multiples of kInputMultiple.
  /// @return           [B, 313, H/4, W/4] logits, in the type of the weights.
  torch::Tensor forward(const torch::Tensor& lightness);
  ColorizerFeatures features(const torch::Tensor& lightness);

  [[nodiscard]] const std::shared_ptr<const Encoder>& encoder() const { return encoder_; }
  using Module::to;
  /// The encoder goes with it, as it does not in moves that also change the type.
  void to(torch::Device device, bool non_blocking = false) override;

  /// Adds [313] to the logits' bias: a fixed change of the class prior costs nothing at run time.
  void shift_logits(const torch::Tensor& offsets);

 private:
  torch::Tensor bottleneck(const torch::Tensor& at32);

  std::shared_ptr<const Encoder> encoder_;
  ConvUnit stem_{nullptr}, down4_{nullptr}, down8_{nullptr}, down16_{nullptr}, down32_{nullptr};
  ConvUnit join16_{nullptr}, join8_{nullptr}, join4_{nullptr};
  torch::nn::Sequential encode2_{nullptr}, encode4_{nullptr}, encode8_{nullptr}, encode16_{nullptr}, encode32_{nullptr};
  torch::nn::Sequential decode16_{nullptr}, decode8_{nullptr}, decode4_{nullptr};
  AttentionUnit attention0_{nullptr}, attention1_{nullptr};
  torch::nn::Linear global_{nullptr};
  torch::nn::Dropout dropout_{nullptr};
  torch::nn::Conv2d classify_{nullptr};
  ConvUnit see4_{nullptr}, see8_{nullptr}, see16_{nullptr}, see32_{nullptr};  ///< empty without an encoder
};
TORCH_MODULE(ColorizerNet);

/// The same function as `trained` in evaluation mode, without its batch normalisation layers, if it has any.
[[nodiscard]] ColorizerNet fold_batch_norm(const ColorizerNet& trained);

[[nodiscard]] std::int64_t parameter_count(const torch::nn::Module& module);

}  // namespace cnerf
