#include "src/colorizer/torch/network_decode.h"

#include <algorithm>
#include <cmath>

#include "src/base/check.h"
#include "src/color/ab_bins.h"

namespace cnerf {
namespace F = torch::nn::functional;
using torch::Tensor;

namespace {

constexpr double kLightnessSigma = 10.0;  // L* units
constexpr double kMostAspect = 8;         // of a sliver narrower than that, the long side decides

/// Where the pixels of one axis lie on a grid of cells.
struct CellsOfPixels {
  Tensor cell;    ///< [pixels] i64, whose area holds the pixel's centre
  Tensor offset;  ///< [pixels] f32, of the pixel's centre from the cell's, in cells

  CellsOfPixels(std::int64_t cells, std::int64_t pixels, const torch::TensorOptions& options) {
    const Tensor place = (torch::arange(pixels, options) + 0.5) * (double(cells) / double(pixels));
    cell = place.to(torch::kInt64).clamp_max(cells - 1);
    offset = place - cell - 0.5;
  }
  /// Quadratic B-spline of the distance to the cell `shift` cells further: three cells and no step where they change.
  [[nodiscard]] Tensor weight(int shift) const {
    if (shift == 0) return 0.75 - offset.square();
    return 0.5 * (0.5 + shift * offset).square();
  }
};

/// Cubic, with the wider kernel that shrinking needs.
Tensor resample(const Tensor& planes, std::int64_t height, std::int64_t width) {
  if (planes.size(2) == height && planes.size(3) == width) return planes;
  return F::interpolate(planes, F::InterpolateFuncOptions()
                                    .size(std::vector<std::int64_t>{height, width})
                                    .mode(torch::kBicubic)
                                    .align_corners(false)
                                    .antialias(true));
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

Tensor certainty_map(const Tensor& logits) {
  const Tensor log_p = torch::log_softmax(logits.to(torch::kFloat32), 1);
  return (log_p.exp() * log_p).sum(1, true).exp();
}

Tensor guided_upsample(const Tensor& cells, const Tensor& lightness) {
  const std::int64_t height = lightness.size(2), width = lightness.size(3);
  const CellsOfPixels rows(cells.size(2), height, lightness.options());
  const CellsOfPixels columns(cells.size(3), width, lightness.options());

  const auto border = F::PadFuncOptions({1, 1, 1, 1}).mode(torch::kReplicate);
  const Tensor wide_cells = F::pad(cells, border);
  const Tensor wide_lightness = F::pad(torch::adaptive_avg_pool2d(lightness, {cells.size(2), cells.size(3)}), border);
  const auto neighbour = [&](const Tensor& wide, int dy, int dx) {
    return wide.index_select(2, rows.cell + 1 + dy).index_select(3, columns.cell + 1 + dx);
  };

  Tensor sum = torch::zeros({cells.size(0), cells.size(1), height, width}, cells.options());
  Tensor weight_sum = torch::zeros_like(lightness);
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const Tensor spatial = rows.weight(dy).unsqueeze(1) * columns.weight(dx).unsqueeze(0);
      const Tensor difference = neighbour(wide_lightness, dy, dx) - lightness;
      // The small floor keeps the sum above zero where no cell is close in lightness.
      const Tensor range = torch::exp(-difference.square() / (2 * kLightnessSigma * kLightnessSigma)) + 1e-3;
      const Tensor weight = range * spatial;
      sum += weight * neighbour(wide_cells, dy, dx);
      weight_sum += weight;
    }
  }
  return sum / weight_sum;
}

Tensor ask_network(ColorizerNet& network, const Tensor& lightness, int short_side) {
  constexpr std::int64_t kMultiple = ColorizerNetImpl::kInputMultiple;
  const std::int64_t height = lightness.size(2), width = lightness.size(3);
  const double scale =
      short_side * std::min(1 / double(std::min(height, width)), kMostAspect / double(std::max(height, width)));
  const auto asked = [&](std::int64_t side) {
    return kMultiple * std::max<std::int64_t>(1, std::llround(double(side) * scale / kMultiple));
  };
  return network->forward(resample(lightness, asked(height), asked(width)).clamp(0, 100));
}

Tensor read_answer(const Tensor& logits, const Tensor& lightness, const AbDecoding& decoding) {
  return guided_upsample(decode_ab(logits, decoding), lightness);
}

Tensor colorize_lightness(ColorizerNet& network, const Tensor& lightness, const AbDecoding& decoding) {
  return read_answer(ask_network(network, lightness, decoding.short_side), lightness, decoding);
}

}  // namespace cnerf
