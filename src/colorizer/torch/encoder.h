#pragma once
/// A frozen encoder that was trained to name what photographs show: ResNet-50 (He et al. 2016) as Keras has it, read
/// from files that the user installs (scripts/install_dependencies.sh --encoder). Colorizers ask it what a grey picture
/// shows, evaluation how pictures in colour look.

#include <torch/torch.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/colorizer/layers_model.h"
#include "src/colorizer/picture_encoder.h"

namespace cnerf {

/// A convolution with the batch normalisation after it multiplied in.
struct FoldedConv {
  torch::Tensor weight;  ///< [out, in, h, w], channels last
  torch::Tensor bias;    ///< [out]
  std::int64_t stride = 1;

  /// Padded so that only the stride changes the size.
  [[nodiscard]] torch::Tensor operator()(const torch::Tensor& x) const;
};

/// A weight of the model as a tensor of its own, in the model's order of axes.
/// @throws InputError  see LayersModel::weight.
[[nodiscard]] torch::Tensor tensor_of(const LayersModel& model, const std::string& name,
                                      const std::vector<std::int64_t>& shape);

/// Convolution `conv` [h, w, in, out] with bias, and the batch normalisation `norm`.
/// @param shape  of the kernel, as the model has it  @throws InputError  naming the weight that does not fit.
[[nodiscard]] FoldedConv folded_conv(const LayersModel& model, const std::string& conv, const std::string& norm,
                                     const std::vector<std::int64_t>& shape);

class Encoder final : public PictureEncoder {
 public:
  static constexpr std::int64_t kInputMultiple = 32;  ///< of both sides, pixels: the grids of stages then cover them
  static constexpr std::size_t kStages = 4;

  /// The widths are those of the model: of w filters in its first layer, 4 w, 8 w, 16 w and 32 w channels.
  /// @throws InputError  naming the weight that is missing or has another shape than this network's.
  explicit Encoder(const LayersModel& model);

  /// The same network on another device.
  [[nodiscard]] Encoder on(torch::Device device) const;

  /// Calls are independent of each other; the caller chooses the number of threads.
  /// @param lightness  [B, 1, H, W] L* 0..100, multiples of kInputMultiple, on the encoder's device.
  /// @return           of each stage [B, channels()[i], H / 4 / 2^i, W / 4 / 2^i], not negative.
  [[nodiscard]] std::vector<torch::Tensor> features(const torch::Tensor& lightness) const;
  /// Of the last stage; of an encoder on the CPU.
  [[nodiscard]] std::vector<float> regions(std::span<const std::uint8_t> rgb, int width, int height) const override;
  [[nodiscard]] const std::vector<std::int64_t>& channels() const { return channels_; }
  [[nodiscard]] const std::string& sha256() const { return sha256_; }
  [[nodiscard]] torch::Device device() const { return stem_.weight.device(); }

 private:
  [[nodiscard]] std::vector<torch::Tensor> stages_of(const torch::Tensor& picture) const;
  struct Block {
    FoldedConv reduce, middle, expand;
    std::optional<FoldedConv> shortcut;  ///< of the first block of a stage
    [[nodiscard]] torch::Tensor operator()(const torch::Tensor& x) const;
  };
  [[nodiscard]] static Block block(const LayersModel& model, const std::string& name, std::int64_t in,
                                   std::int64_t width, std::int64_t stride);

  FoldedConv stem_;
  std::vector<std::vector<Block>> stages_;
  std::vector<std::int64_t> channels_;
  std::string sha256_;
};

/// The encoder in `folder`.  @throws MissingInputError, InputError  see read_layers_model and Encoder.
[[nodiscard]] std::shared_ptr<const Encoder> load_encoder(const std::filesystem::path& folder);

/// The one that the user has installed, which `what` needs.
/// @throws MissingInputError  naming where it is looked for, and how it is installed.
[[nodiscard]] std::shared_ptr<const Encoder> installed_encoder(const std::string& what);

/// `make_picture_encoder` inside the plug-in: it is installed.
[[nodiscard]] std::unique_ptr<PictureEncoder> make_torch_picture_encoder();

}  // namespace cnerf
