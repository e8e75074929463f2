#include "src/colorizer/network_decode.h"

#include "src/base/check.h"
#include "src/color/ab_bins.h"

namespace cnerf {
namespace F = torch::nn::functional;
using torch::Tensor;
using torch::indexing::None;
using torch::indexing::Slice;

namespace {

constexpr std::int64_t kStride = ColorizerNetImpl::kOutputStride;
constexpr double kSpatialSigma = 0.7;     // blocks
constexpr double kLightnessSigma = 10.0;  // L* units

/// Repeats every block kStride times in both directions and cuts to [height, width].
Tensor spread(const Tensor& blocks, std::int64_t height, std::int64_t width) {
  const std::int64_t batch = blocks.size(0), channels = blocks.size(1), rows = blocks.size(2), columns = blocks.size(3);
  const Tensor full = blocks.unsqueeze(3).unsqueeze(5).expand({batch, channels, rows, kStride, columns, kStride});
  return full.reshape({batch, channels, rows * kStride, columns * kStride})
      .index({Slice(), Slice(), Slice(None, height), Slice(None, width)});
}

/// exp(-d^2 / 2 sigma^2) of a pixel's distance, in blocks, to the block `shift` blocks from its own.  [length]
Tensor spatial_weight(int shift, std::int64_t length, const torch::TensorOptions& options) {
  const Tensor inside = (torch::arange(length, options).remainder(kStride) + 0.5) / static_cast<double>(kStride) - 0.5;
  return torch::exp(-(inside - shift).square() / (2 * kSpatialSigma * kSpatialSigma));
}

}  // namespace

Tensor ab_centres_tensor(torch::Device device) {
  std::vector<float> values;
  for (const Ab& centre : ab_bin_centres()) values.insert(values.end(), {centre.a, centre.b});
  return torch::tensor(values).view({kAbBinCount, 2}).to(device);
}

Tensor decode_ab(const Tensor& logits, const AbDecoding& decoding) {
  CNERF_CHECK_EQ(logits.size(1), kAbBinCount);
  const Tensor probability =
      torch::softmax(logits.to(torch::kFloat32).permute({0, 2, 3, 1}) / decoding.temperature, -1);
  const Tensor ab = torch::matmul(probability, ab_centres_tensor(logits.device())) * decoding.gain;
  return ab.permute({0, 3, 1, 2}).contiguous();
}

Tensor guided_upsample(const Tensor& blocks, const Tensor& lightness) {
  const std::int64_t height = lightness.size(2), width = lightness.size(3);
  const std::int64_t bottom = blocks.size(2) * kStride - height, right = blocks.size(3) * kStride - width;
  CNERF_CHECK(bottom >= 0 && bottom < kStride && right >= 0 && right < kStride,
              "blocks are a quarter of the lightness");
  const Tensor padded = F::pad(lightness, F::PadFuncOptions({0, right, 0, bottom}).mode(torch::kReplicate));
  const Tensor block_lightness = torch::avg_pool2d(padded, kStride);

  const auto border = F::PadFuncOptions({1, 1, 1, 1}).mode(torch::kReplicate);
  const Tensor wide_blocks = F::pad(blocks, border), wide_lightness = F::pad(block_lightness, border);
  const auto shifted = [&](const Tensor& wide, int dy, int dx) {
    const Tensor window =
        wide.index({Slice(), Slice(), Slice(1 + dy, 1 + dy + blocks.size(2)), Slice(1 + dx, 1 + dx + blocks.size(3))});
    return spread(window, height, width);
  };

  Tensor sum = torch::zeros({blocks.size(0), blocks.size(1), height, width}, blocks.options());
  Tensor weight_sum = torch::zeros_like(lightness);
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const Tensor spatial = spatial_weight(dy, height, lightness.options()).unsqueeze(1) *
                             spatial_weight(dx, width, lightness.options()).unsqueeze(0);
      const Tensor difference = shifted(wide_lightness, dy, dx) - lightness;
      // The small floor keeps the sum above zero where no block is close in lightness.
      const Tensor range = torch::exp(-difference.square() / (2 * kLightnessSigma * kLightnessSigma)) + 1e-3;
      const Tensor weight = range * spatial;
      sum += weight * shifted(wide_blocks, dy, dx);
      weight_sum += weight;
    }
  }
  return sum / weight_sum;
}

Tensor logits_with_flips(ColorizerNet& network, const Tensor& lightness) {
  const Tensor logits = network->forward(lightness);
  // Blocks of the mirror image line up with ours only where the width is a multiple of the stride.
  if (lightness.size(3) % kStride != 0) return logits;
  return 0.5 * (logits + network->forward(lightness.flip({3})).flip({3}));
}

Tensor colorize_with_flips(ColorizerNet& network, const Tensor& lightness, const AbDecoding& decoding) {
  return guided_upsample(decode_ab(logits_with_flips(network, lightness), decoding), lightness);
}

}  // namespace cnerf
