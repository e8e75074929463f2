#include "src/colorizer_training/batch.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "src/base/rng.h"
#include "src/colorizer/torch/lab_tensors.h"

namespace cnerf::colorizer_training {
namespace F = torch::nn::functional;
using torch::Tensor;

namespace {

// Crops. A patch's side is a share of the short side, as a scene's patches have it.
constexpr float kPatchShare = 0.5f;  // of the crops
constexpr float kPatchLeast = 0.3f, kPatchMost = 0.7f;
constexpr float kWholeLeast = 0.6f;    // least side of the others
constexpr double kRotation = 12;       // degrees, either way
constexpr double kAspect = 1.25;       // log-uniform from its inverse to this
constexpr float kCutMixShare = 0.25f;  // of the batches
// Lightness.
constexpr float kGammaReach = 0.35f;                         // of the logarithm, either way
constexpr float kContrastReach = 0.3f;                       // relative, either way
constexpr float kShiftReach = 8;                             // L*, either way
constexpr double kBlurredShare = 0.6;                        // of the crops
constexpr float kMostBlur = 1.6f;                            // sigma, pixels
constexpr int kBlurRadius = 4;                               // pixels; 2.5 times the largest sigma
constexpr float kMostNoise = 2.5f, kMostCoarseNoise = 3.0f;  // standard deviations, L*

float log_uniform(SequentialRng& rng, double largest_ratio) {
  const float log_ratio = float(std::log(largest_ratio));
  return std::exp(rng.uniform(-log_ratio, log_ratio));
}

/// Map from the crop's [-1, 1]^2 to the canvas's, with the photograph's true aspect: six numbers, row-major 2x3.
void append_crop(float aspect, SequentialRng& rng, std::vector<float>& theta) {
  const float width = std::max(1.0f, aspect), height = std::max(1.0f, 1 / aspect);  // short side 1
  const bool patch = rng.uniform() < kPatchShare;
  const float scale = patch ? rng.uniform(kPatchLeast, kPatchMost) : rng.uniform(kWholeLeast, 1);
  const float stretch = std::sqrt(log_uniform(rng, kAspect));
  const float crop_width = std::min(1.0f, scale * stretch), crop_height = std::min(1.0f, scale / stretch);
  const float x = rng.uniform(crop_width / 2, width - crop_width / 2);
  const float y = rng.uniform(crop_height / 2, height - crop_height / 2);
  const float angle = rng.uniform(-1, 1) * float(kRotation * std::numbers::pi / 180);
  const float flip = rng.uniform() < 0.5f ? -1.0f : 1.0f;
  const float c = std::cos(angle), s = std::sin(angle);
  theta.insert(theta.end(), {crop_width * c * flip / width, -crop_height * s / width, 2 * x / width - 1,
                             crop_width * s * flip / height, crop_height * c / height, 2 * y / height - 1});
}

/// How one crop's lightness is changed; one row of the tensor that the device works with.
enum LightnessColumn { kGamma, kContrast, kShift, kBlur, kNoise, kCoarseNoise, kLightnessColumns };

void append_lightness(SequentialRng& rng, std::vector<float>& rows) {
  const float gamma = std::exp(rng.uniform(-1, 1) * kGammaReach);
  const float contrast = 1 + rng.uniform(-1, 1) * kContrastReach;
  const float shift = rng.uniform(-1, 1) * kShiftReach;
  const float blur = rng.uniform() < kBlurredShare ? rng.uniform(0.2f, kMostBlur) : 0.1f;
  const float noise = rng.uniform() < 0.5f ? rng.uniform() * kMostNoise : 0;
  const float coarse = rng.uniform() < 0.3f ? rng.uniform() * kMostCoarseNoise : 0;
  rows.insert(rows.end(), {gamma, contrast, shift, blur, noise, coarse});
}

/// A Gaussian of its own for every image.  @param sigma  [B].
Tensor blur_each(const Tensor& planes, const Tensor& sigma) {
  const std::int64_t batch = planes.size(0), side = 2 * kBlurRadius + 1;
  const Tensor offset = torch::arange(-kBlurRadius, kBlurRadius + 1, planes.options());
  Tensor kernel = torch::exp(-offset.square().unsqueeze(0) / (2 * sigma.square()).unsqueeze(1));  // [B, side]
  kernel = kernel / kernel.sum(1, true);
  const auto border = F::PadFuncOptions({kBlurRadius, kBlurRadius, kBlurRadius, kBlurRadius}).mode(torch::kReplicate);
  Tensor all = F::pad(planes, border).transpose(0, 1);  // images become channels: [1, B, H, W]
  all = torch::conv2d(all, kernel.view({batch, 1, 1, side}), /*bias=*/Tensor(), {1}, torch::IntArrayRef{0}, {1}, batch);
  all = torch::conv2d(all, kernel.view({batch, 1, side, 1}), /*bias=*/Tensor(), {1}, torch::IntArrayRef{0}, {1}, batch);
  return all.transpose(0, 1);
}

Tensor change_lightness(const Tensor& lightness, const Tensor& rows) {
  const auto column = [&](int i) { return rows.select(1, i).view({-1, 1, 1, 1}); };
  Tensor l = blur_each(lightness, rows.select(1, kBlur));
  l = 100 * torch::pow((l / 100).clamp(1e-4, 1), column(kGamma));
  const Tensor mean = l.mean({2, 3}, true);
  l = (l - mean) * column(kContrast) + mean + column(kShift);
  l = l + torch::randn_like(l) * column(kNoise);
  const Tensor coarse = torch::randn({l.size(0), 1, l.size(2) / 8, l.size(3) / 8}, l.options());
  l = l + column(kCoarseNoise) * F::interpolate(coarse, F::InterpolateFuncOptions()
                                                            .size(std::vector<std::int64_t>{l.size(2), l.size(3)})
                                                            .mode(torch::kBilinear)
                                                            .align_corners(false));
  return l.clamp(0, 100);
}

/// A rectangle of a crop: rows and columns [first, last).
struct Box {
  std::int64_t top = 0, bottom = 0, left = 0, right = 0;
};

/// A random one with borders on the grid of the quarter-resolution targets.
Box random_box(int crop_side, SequentialRng& rng) {
  const auto span = [&](std::int64_t& first, std::int64_t& last) {
    const std::int64_t length = 4 * (crop_side / 16 + rng.below(std::uint32_t(crop_side / 8)));
    first = 4 * rng.below(std::uint32_t((crop_side - length) / 4 + 1));
    last = first + length;
  };
  Box box;
  span(box.top, box.bottom);
  span(box.left, box.right);
  return box;
}

/// CutMix (Yun et al. 2019) inside one kind's part of the batch: the next image's rectangle over each image.
void cut_and_paste(Batch& batch, int first, int count, const Box& box) {
  if (count == 0) return;
  const auto label = batch.mixed_label.begin() + first;
  std::rotate(label, label + 1, label + count);
  const Tensor part = batch.rgb.slice(0, first, first + count);
  const Tensor target = part.slice(2, box.top, box.bottom).slice(3, box.left, box.right);
  target.copy_(target.roll(-1, 0));
}

}  // namespace

Tensor upload(const Tensor& host, torch::Device device) {
  return device.is_cuda() ? host.pin_memory().to(device, /*non_blocking=*/true) : host;
}

ResidentImages::ResidentImages(const TrainingImages& images, torch::Device device)
    : aspect(images.aspect), label(images.label) {
  const std::int64_t count = std::int64_t(images.size()), side = images.side;
  auto* bytes = const_cast<std::uint8_t*>(images.rgb.data());
  rgb_ = torch::from_blob(bytes, {count, side, side, 3}, torch::kUInt8).to(device, torch::kUInt8, false, true);
}

Tensor ResidentImages::gather(const Tensor& index) const {
  return rgb_.index_select(0, index).permute({0, 3, 1, 2}).to(torch::kFloat32) / 255;
}

Picture picture_from_lab(const Tensor& lightness, const Tensor& ab) {
  const Tensor srgb = srgb_from_lab(lightness.unsqueeze(0), ab.unsqueeze(0))[0].permute({1, 2, 0});
  const Tensor bytes = (srgb * 255).round().to(torch::kCPU, torch::kUInt8).contiguous();
  const auto* first = bytes.data_ptr<std::uint8_t>();
  return {int(bytes.size(1)), int(bytes.size(0)), {first, first + bytes.numel()}};
}

Batch make_batch(const std::vector<Draw>& draws, int crop_side, std::uint64_t seed, std::int64_t step) {
  const torch::NoGradGuard no_grad;
  const torch::Device device = draws.at(0).images->device();
  SequentialRng rng(seed, std::uint64_t(step));
  Batch batch;
  std::vector<Tensor> crops;
  std::vector<float> lightness_rows;
  const bool mix = rng.uniform() < kCutMixShare;
  const Box box = mix ? random_box(crop_side, rng) : Box();
  for (const auto& [images, count] : draws) {
    if (count == 0) continue;
    std::vector<std::int64_t> index;
    std::vector<float> theta;
    for (int i = 0; i < count; ++i) {
      const auto drawn = std::min(std::size_t(rng.uniform() * double(images->size())), images->size() - 1);
      index.push_back(std::int64_t(drawn));
      append_crop(images->aspect[drawn], rng, theta);
      append_lightness(rng, lightness_rows);
      batch.label.push_back(images->label[drawn]);
    }
    const Tensor grid = F::affine_grid(upload(torch::tensor(theta).view({count, 2, 3}), device),
                                       {count, 3, crop_side, crop_side}, /*align_corners=*/false);
    crops.push_back(F::grid_sample(
        images->gather(upload(torch::tensor(index), device)), grid,
        F::GridSampleFuncOptions().mode(torch::kBilinear).padding_mode(torch::kReflection).align_corners(false)));
  }
  batch.rgb = torch::cat(crops);
  batch.mixed_label = batch.label;
  if (mix) {
    int first = 0;
    for (const Draw& draw : draws) {
      cut_and_paste(batch, first, draw.count, box);
      first += draw.count;
    }
    const auto area = double((box.bottom - box.top) * (box.right - box.left));
    batch.mixed_share = area / (double(crop_side) * crop_side);
  }
  const LabPlanes lab = lab_from_srgb(batch.rgb);
  batch.ab = torch::avg_pool2d(lab.ab, 4);
  torch::manual_seed(std::int64_t(mix_bits(seed) ^ std::uint64_t(step)));
  const Tensor rows = torch::tensor(lightness_rows).view({-1, kLightnessColumns});
  batch.lightness = change_lightness(lab.lightness, upload(rows, device));
  return batch;
}

}  // namespace cnerf::colorizer_training
