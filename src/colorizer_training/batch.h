#pragma once
/// Training batches: random crops of the resident images, with lightness as a radiance field would render it.

#include <torch/torch.h>

#include <cstdint>
#include <vector>

#include "src/colorizer_training/image_set.h"

namespace cnerf::colorizer_training {

/// Images that stay on the training device, as bytes.
class ResidentImages {
 public:
  ResidentImages(const TrainingImages& images, torch::Device device);
  /// @param index  [B] i64.  @return [B, 3, side, side] f32, 0..1 sRGB.
  [[nodiscard]] torch::Tensor gather(const torch::Tensor& index) const;

  [[nodiscard]] std::size_t size() const { return aspect.size(); }
  [[nodiscard]] torch::Device device() const { return rgb_.device(); }

  std::vector<float> aspect;
  std::vector<int> label;

 private:
  torch::Tensor rgb_;  ///< [N, side, side, 3] u8
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

/// sRGB bytes of Lab planes [1, H, W], [2, H, W], clamped: for pictures to look at.
[[nodiscard]] Picture picture_from_lab(const torch::Tensor& lightness, const torch::Tensor& ab);

/// So many crops of one kind of images.
struct Draw {
  const ResidentImages* images;
  int count;
};
/// The batch of one step: a pure function of the images, the seed and the step.
/// @param draws  their crops follow one another in the batch
[[nodiscard]] Batch make_batch(const std::vector<Draw>& draws, int crop_side, std::uint64_t seed, std::int64_t step);

}  // namespace cnerf::colorizer_training
