#pragma once
/// Nearest-neighbour feature matching (ARF: Zhang et al. 2022): how unlike a reference image a picture's features are.

#include <filesystem>
#include <memory>
#include <span>
#include <vector>

namespace cnerf::compare {

/// A picture as lightness and chroma.
struct LabPicture {
  int width = 0, height = 0;
  std::vector<float> lightness;  ///< [H, W] L* 0..100
  std::vector<float> ab;         ///< [2, H, W]
};

/// Mean over feature vectors of 1 - cosine to the most similar feature vector of the reference (ARF, Eq. 1), summed
/// over AlexNet's second and third convolution. LibTorch computes it, in a plug-in, on CUDA where it can.
class StyleLoss {
 public:
  static constexpr int kLeastSide = 32;  ///< pixels of a picture's shorter side

  virtual ~StyleLoss() = default;
  /// The loss of a picture.
  /// @param gradient  [2, H, W], of the loss with respect to ab; lightness is fixed
  [[nodiscard]] virtual double operator()(const LabPicture& picture, std::span<float> gradient) const = 0;
};

/// @param weights  of AlexNet, as `Lpips` takes them
/// @throws MissingInputError, InputError  naming the file; also for a reference that is too small.
[[nodiscard]] std::unique_ptr<StyleLoss> make_style_loss(const std::filesystem::path& weights,
                                                         const LabPicture& reference);

}  // namespace cnerf::compare
