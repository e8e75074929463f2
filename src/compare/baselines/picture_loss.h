#pragma once
/// How far a picture is from what is wanted: from the features of a reference image (ARF: Zhang et al. 2022), or from a
/// text (CLIP-NeRF: Wang et al. 2022).

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace cnerf::compare {

/// A picture as lightness and chroma.
struct LabPicture {
  int width = 0, height = 0;
  std::vector<float> lightness;  ///< [H, W] L* 0..100
  std::vector<float> ab;         ///< [2, H, W]
};

/// LibTorch computes it, in a plug-in, on CUDA where it can.
class PictureLoss {
 public:
  static constexpr int kLeastSide = 32;  ///< pixels of a picture's shorter side

  virtual ~PictureLoss() = default;
  /// The loss of a picture.
  /// @param gradient  [2, H, W], of the loss with respect to ab; lightness is fixed
  [[nodiscard]] virtual double operator()(const LabPicture& picture, std::span<float> gradient) const = 0;
};

/// Mean over feature vectors of 1 - cosine to the most similar feature vector of the reference (ARF, Eq. 1), summed
/// over AlexNet's second and third convolution.
/// @param weights  of AlexNet, as `Lpips` takes them
/// @throws MissingInputError, InputError  naming the file; also for a reference that is too small.
[[nodiscard]] std::unique_ptr<PictureLoss> make_style_loss(const std::filesystem::path& weights,
                                                           const LabPicture& reference);

/// A text, and the user's pair of networks as TorchScript that compares pictures with it.
struct TextGuide {
  std::filesystem::path image_encoder;  ///< [1, 3, 224, 224], normalised as CLIP's training did, to [1, D]
  std::filesystem::path text_encoder;   ///< a string to [1, D] or [D]
  std::string text;
};
/// 1 - cosine of what the encoders make of the picture and of the text. Pictures are squeezed to 224 x 224 whole.
/// @throws MissingInputError, InputError  naming the file: no TorchScript, or not such an encoder.
[[nodiscard]] std::unique_ptr<PictureLoss> make_text_loss(const TextGuide& guide);

}  // namespace cnerf::compare
