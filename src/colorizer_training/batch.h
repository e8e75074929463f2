#pragma once
/// Training batches: random crops of the resident images, with lightness as a radiance field would render it.

#include <torch/torch.h>

#include <cstdint>
#include <vector>

#include "src/colorizer_training/image_set.h"

namespace cnerf {

struct AugmentOptions {
  double patch_share = 0.5;                        ///< of crops that look like a scene's patches, s in [0.3, 0.7]
  double scale_min = 0.3, scale_mid = 0.7;         ///< crop side as a share of the short side: patches
  double whole_scale_min = 0.6;                    ///< the other crops: from here to 1
  double rotation_degrees = 12, aspect = 0.25;     ///< +- degrees; log-uniform in 1/(1+a) .. 1+a
  double cutmix = 0.25;                            ///< share of batches
  double gamma = 0.35, contrast = 0.3, shift = 8;  ///< log gamma; relative contrast; L* offset
  double blur_sigma = 1.6, blur_share = 0.6;       ///< pixels of the crop
  double noise = 2.5, coarse_noise = 3.0;          ///< standard deviations up to this, L*
  double tone_strength = 1;                        ///< factor on gamma, contrast and shift
  double wear_strength = 1;                        ///< factor on the shares of blurred and of noisy crops
};

/// Images that stay on the training device, as bytes.
class ResidentImages {
 public:
  ResidentImages(const TrainingImages& images, torch::Device device);
  /// @param index  [B] i64.  @return [B, 3, side, side] f32, 0..1 sRGB.
  [[nodiscard]] torch::Tensor gather(const torch::Tensor& index) const;

  /// The image that a uniform number in [0, 1) draws.
  [[nodiscard]] std::int64_t draw(float uniform) const;
  [[nodiscard]] torch::Device device() const { return rgb_.device(); }

  std::vector<float> aspect;
  std::vector<int> label;

 private:
  std::vector<double> cumulative_;  ///< [N] of the images' weights
  torch::Tensor rgb_;               ///< [N, side, side, 3] u8
};

struct Batch {
  torch::Tensor rgb;                    ///< [B, 3, S, S] sRGB 0..1, before the changes to lightness
  torch::Tensor lightness;              ///< [B, 1, S, S] L*, what the network sees
  torch::Tensor ab;                     ///< [B, 2, S/4, S/4], mean of each block
  std::vector<int> label, mixed_label;  ///< [B]; of the image and of what was pasted over it
  double mixed_share = 0;               ///< of the area that was pasted over
};

/// Host values on the device without waiting for it: copies from pageable memory would drain its queue first.
[[nodiscard]] torch::Tensor upload(const torch::Tensor& host, torch::Device device);

/// Lab of sRGB in 0..1: L* [B, 1, H, W] and ab [B, 2, H, W], by the project's own matrix (grey gives a = b = 0).
struct LabPlanes {
  torch::Tensor lightness, ab;
};
[[nodiscard]] LabPlanes lab_from_srgb(const torch::Tensor& srgb);
/// sRGB 0..1 of Lab planes [B, 1, H, W], [B, 2, H, W], clamped to the gamut by channel.  [B, 3, H, W]
[[nodiscard]] torch::Tensor srgb_from_lab(const torch::Tensor& lightness, const torch::Tensor& ab);
/// sRGB bytes of Lab planes [1, H, W], [2, H, W], clamped: for pictures to look at.
[[nodiscard]] RgbImage image_from_lab(const torch::Tensor& lightness, const torch::Tensor& ab);

/// Images of a batch that are drawn from one set.
struct BatchPart {
  const ResidentImages* images = nullptr;
  int count = 0;
};
/// The batch of one step: a pure function of the images, the seed and the step. Crops of its parts follow one another,
/// on the device of the images.
[[nodiscard]] Batch make_batch(const std::vector<BatchPart>& parts, int crop_side, const AugmentOptions& options,
                               std::uint64_t seed, std::int64_t step);

}  // namespace cnerf
