#pragma once
/// Nearest-neighbour feature matching (ARF: Zhang et al. 2022): how unlike a reference image a picture's features are.

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

struct StyleNetwork;

/// Mean over feature vectors of 1 - cosine to the most similar feature vector of the reference (ARF, Eq. 1), summed
/// over layers. LibTorch computes it, in a plug-in, on CUDA where it can.
class StyleLoss {
 public:
  static constexpr int kLeastSide = 32;  ///< pixels of a picture's shorter side

  /// @param network    weights as `Lpips` takes them, of AlexNet: features behind its second and third convolution; or
  ///                   any other file: a TorchScript module that makes one [1, C, H', W'] tensor or several out of
  ///                   [1, 3, H, W] sRGB in 0..1
  /// @throws MissingInputError, InputError  naming the file; also for a reference that is too small.
  StyleLoss(const std::filesystem::path& network, const LabPicture& reference);
  ~StyleLoss();
  StyleLoss(const StyleLoss&) = delete;
  StyleLoss& operator=(const StyleLoss&) = delete;

  /// The loss of a picture.
  /// @param gradient  [2, H, W], of the loss with respect to ab; lightness is fixed
  [[nodiscard]] double operator()(const LabPicture& picture, std::span<float> gradient) const;
  [[nodiscard]] const std::string& network() const;  ///< "AlexNet", or the file's name

 private:
  std::unique_ptr<StyleNetwork> network_;
};

}  // namespace cnerf::compare
