// Colour of the paper's own field: Theta_Z on the fixed point encoding w.

#include <algorithm>

#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/compare/baselines/torch/positional_nets.h"

namespace cnerf::compare {
namespace {

constexpr std::uint64_t kChromaStream = named_stream("chroma");

class PositionalColorBinEngine final : public ColorBinEngine {
 public:
  /// @param encoding  w to begin with; empty = random
  PositionalColorBinEngine(std::uint64_t seed, Trunk encoding) {
    trunk_->to(torch_device());
    net_->to(torch_device());
    initialise(*trunk_, seed ^ kChromaStream);
    initialise(*net_, seed);
    const torch::NoGradGuard no_gradient;
    if (!encoding.is_empty()) {
      const std::vector<torch::Tensor> from = encoding->parameters();
      std::vector<torch::Tensor> to = trunk_->parameters();
      for (std::size_t i = 0; i < from.size(); ++i) to[i].copy_(from[i]);
    }
    trained_ = std::make_unique<Trained>(joined(net_->parameters(), trunk_->parameters()));
  }

  double fit(const PixelSamples& pixels, std::span<const SoftLabel> labels, std::span<const float> pixel_weights,
             const ChromaLossWeights& more, float learning_rate) override {
    const FastProducts fast;
    const auto n = std::int64_t(labels.size());
    std::vector<std::int64_t> bins;
    std::vector<float> shares, weights(pixel_weights.begin(), pixel_weights.end());
    if (weights.empty()) weights.assign(labels.size(), 1.0f);
    for (const SoftLabel& label : labels) {
      bins.insert(bins.end(), label.bin.begin(), label.bin.end());
      shares.insert(shares.end(), label.weight.begin(), label.weight.end());
    }
    const Composited seen = forward(pixels, 0, pixels.pixels());
    const torch::Tensor logits = net_->classes->forward(seen.features),
                        pixel_weight = tensor_of(weights, {n}, torch::kFloat32);
    torch::Tensor loss =
        positional::classification_loss(logits, tensor_of(bins, {n, kSoftLabelBins}, torch::kInt64),
                                        tensor_of(shares, {n, kSoftLabelBins}, torch::kFloat32), pixel_weight);
    if (more.spread > 0) loss = loss + more.spread * seen.spread() / n;
    if (more.regression > 0) {
      std::vector<float> wanted, centres;
      for (const SoftLabel& label : labels) wanted.insert(wanted.end(), {mean_of(label).a, mean_of(label).b});
      for (const Ab centre : ab_bin_centres()) centres.insert(centres.end(), {centre.a, centre.b});
      const torch::Tensor mean =
          torch::softmax(logits, 1).matmul(tensor_of(centres, {kAbBinCount, 2}, torch::kFloat32));
      const torch::Tensor cost = torch::smooth_l1_loss(mean, tensor_of(wanted, {n, 2}, torch::kFloat32),
                                                       at::Reduction::None, double(kSmoothMean));
      loss = loss + more.regression * (cost.sum(1) * pixel_weight).mean();
    }
    loss.backward();
    trained_->follow(double(learning_rate), step_count());
    return loss.item<double>();
  }

  void logits(const PixelSamples& pixels, std::span<float> logits) const override {
    CNERF_CHECK_EQ(logits.size(), pixels.pixels() * kAbBinCount);
    for_parts(pixels, [&](std::size_t first, const std::vector<float>& part) {
      std::ranges::copy(part, logits.begin() + std::ptrdiff_t(first * kAbBinCount));
    });
  }
  void decode(const PixelSamples& pixels, float temperature, std::span<Ab> colors) const override {
    CNERF_CHECK_EQ(colors.size(), pixels.pixels());
    for_parts(pixels, [&](std::size_t first, const std::vector<float>& part) {
      parallel_ranges(part.size() / kAbBinCount, 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t p = begin; p < end; ++p) {
          const auto of_pixel = std::span(part).subspan(p * kAbBinCount, kAbBinCount);
          colors[first + p] = temperature > 0 ? decode_annealed_mean(of_pixel, temperature) : decode_arg_max(of_pixel);
        }
      });
    });
  }

  [[nodiscard]] std::vector<StatePiece> state() override {
    std::vector<StatePiece> state;
    trained_->append_state("positional_chroma", state);
    state.push_back(steps_piece("chroma_steps"));
    return state;
  }
  void state_loaded() override { trained_->state_loaded(); }

 private:
  struct Composited {
    torch::Tensor features;  ///< [R, kHeadWidth]
    torch::Tensor hidden;    ///< [S, kHeadWidth], features of samples
    torch::Tensor share;     ///< [S, 1]

    /// Sum over pixels (chroma_math.h).
    [[nodiscard]] torch::Tensor spread() const { return (share * hidden.square()).sum() - features.square().sum(); }
  };
  /// Of the pixels in [begin, end).
  [[nodiscard]] Composited forward(const PixelSamples& pixels, std::size_t begin, std::size_t end) const {
    const std::size_t first = pixels.offsets[begin], count = pixels.offsets[end] - first;
    std::vector<std::int64_t> pixel_of(count);
    std::vector<float> share(count), positions;
    for (std::size_t p = begin; p < end; ++p) {
      float opacity = 0;
      for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) opacity += pixels.weights[s];
      for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) {
        pixel_of[s - first] = std::int64_t(p - begin);
        share[s - first] = pixels.weights[s] * inverse_opacity(opacity);
        const Vec3f& x = pixels.positions[s];
        positions.insert(positions.end(), {x.x, x.y, x.z});
      }
    }
    const auto n = std::int64_t(count);
    torch::Tensor w;
    {
      const torch::NoGradGuard no_gradient;  // w stays fixed
      w = trunk_->forward(tensor_of(positions, {n, 3}, torch::kFloat32));
    }
    const torch::Tensor hidden = net_->hidden(w), shares = tensor_of(share, {n, 1}, torch::kFloat32);
    const torch::Tensor composited = torch::zeros({std::int64_t(end - begin), kHeadWidth}, hidden.options())
                                         .index_add(0, tensor_of(pixel_of, {n}, torch::kInt64), hidden * shares);
    return {composited, hidden, shares};
  }

  /// Calls `use(first pixel, logits)` for pixels of about kPointsAtATime samples at a time.
  template <typename Use>
  void for_parts(const PixelSamples& pixels, Use&& use) const {
    const torch::NoGradGuard no_gradient;
    const FastProducts fast;
    for (std::size_t begin = 0; begin < pixels.pixels();) {
      std::size_t end = begin + 1;
      while (end < pixels.pixels() && end - begin < std::size_t(kPointsAtATime) &&
             pixels.offsets[end + 1] - pixels.offsets[begin] <= std::size_t(kPointsAtATime)) {
        ++end;
      }
      use(begin, floats_of(net_->classes->forward(forward(pixels, begin, end).features)));
      begin = end;
    }
  }

  mutable Trunk trunk_;  // modules know no const
  mutable ChromaNet net_;
  std::unique_ptr<Trained> trained_;
};

}  // namespace

std::unique_ptr<ColorBinEngine> make_positional_color_bins(std::uint64_t seed, Trunk encoding) {
  return std::make_unique<PositionalColorBinEngine>(seed, std::move(encoding));
}

}  // namespace cnerf::compare
