#include <tbb/enumerable_thread_specific.h>

#include <array>
#include <cmath>

#include "src/base/check.h"
#include "src/engine/color_engines.h"
#include "src/engine/cpu/step_chunks.h"
#include "src/field/cpu/point_net.h"
#include "src/field/nets.h"

namespace cnerf {
namespace {

constexpr int kFeatures = kChromaFeatures;
constexpr int kHeadInputs = kChromaHeadInputs;
constexpr int kHeadOutputs = kChromaHeadOutputs;

class ColorBinEngineCpu final : public ColorBinEngine {
 public:
  ColorBinEngineCpu(const HashGridOptions& grid, std::uint64_t seed)
      : features_(grid, kFeatures, /*relu_output=*/true, seed),
        head_({{kHeadInputs, kHeadOutputs}}, seed, kChromaHeadStream) {
    head_.set_weights(initial_chroma_head(seed));
  }

  void share_steps(const StepShare& share) override { share_ = share; }
  double fit(const PixelSamples& pixels, std::span<const SoftLabel> labels, std::span<const float> pixel_weights,
             const ChromaLossWeights& more, float learning_rate) override {
    const float scale = 1.0f / float(pixels.pixels());
    const auto [own, last] = share_.range(pixels.pixels(), kPixelsPerBlock);
    chunks_.run(last - own, kPixelsPerBlock, features_.weight_count() + head_.layout().weight_count(),
                [&, shift = own](StepChunk& chunk, std::size_t from, std::size_t to) {
                  const std::size_t begin = shift + from, end = shift + to;
                  Work& work = works_.local();
                  forward(pixels, begin, end, work);
                  for (std::size_t p = begin; p < end; ++p) {
                    const float weight = pixel_weights.empty() ? 1.0f : pixel_weights[p];
                    chunk.loss += weight * loss_gradient(work, p - begin, labels[p], more.regression, weight * scale);
                  }
                  clear_padding(work, end - begin);
                  const double spread = backward(pixels, begin, end, spread_slope(more.spread, scale), work, chunk);
                  chunk.loss += more.spread * spread;
                });
    const auto [d_weights, total] = chunks_.sums(share_);
    const auto split = std::ptrdiff_t(features_.weight_count());
    features_.update(chunks_.runs(), {d_weights.begin(), d_weights.begin() + split}, learning_rate, step_count(),
                     share_.sum);
    head_.update({d_weights.begin() + split, d_weights.end()}, AdamStep(learning_rate, step_count()));
    return total * scale;
  }

  void logits(const PixelSamples& pixels, std::span<float> logits) const override {
    CNERF_CHECK_EQ(logits.size(), pixels.pixels() * kAbBinCount);
    parallel_ranges(pixels.pixels(), kPixelsPerBlock, [&](std::size_t begin, std::size_t end) {
      Work& work = works_.local();
      forward(pixels, begin, end, work);
      const GroupedView<const float> of_block(work.logits, kHeadOutputs);
      for (std::size_t p = begin; p < end; ++p) {
        for (int q = 0; q < kAbBinCount; ++q) logits[p * kAbBinCount + q] = of_block.at(p - begin, q);
      }
    });
  }

  void decode(const PixelSamples& pixels, float temperature, std::span<Ab> colors) const override {
    CNERF_CHECK_EQ(colors.size(), pixels.pixels());
    parallel_ranges(pixels.pixels(), kPixelsPerBlock, [&](std::size_t begin, std::size_t end) {
      Work& work = works_.local();
      forward(pixels, begin, end, work);
      const GroupedView<const float> logits(work.logits, kHeadOutputs);
      std::array<float, kAbBinCount> of_pixel;
      for (std::size_t p = begin; p < end; ++p) {
        for (int q = 0; q < kAbBinCount; ++q) of_pixel[std::size_t(q)] = logits.at(p - begin, q);
        colors[p] = temperature > 0 ? decode_annealed_mean(of_pixel, temperature) : decode_arg_max(of_pixel);
      }
    });
  }

  [[nodiscard]] std::vector<StatePiece> state() override {
    std::vector<StatePiece> state;
    features_.append_state("features", state);
    head_.append_state("head", state);
    state.push_back(steps_piece("chroma_steps"));
    return state;
  }
  void state_loaded() override {
    features_.state_loaded();
    head_.transpose_weights();
  }

 private:
  struct Work {
    PointWorkspace points;
    AlignedVector<float> composited, logits, d_composited, d_logits;  // pixels as lanes
  };

  void forward(const PixelSamples& pixels, std::size_t begin, std::size_t end, Work& work) const {
    const std::size_t first = pixels.offsets[begin];
    features_.set_points(std::span(pixels.positions).subspan(first, pixels.offsets[end] - first), work.points);
    features_.forward(work.points);

    const std::size_t groups = groups_of(end - begin);
    ensure_size(work.composited, groups * kHeadInputs * kGroup);
    std::fill_n(work.composited.begin(), groups * kHeadInputs * kGroup, 0.0f);
    const GroupedView<float> composited(work.composited, kHeadInputs);
    const GroupedView<const float> features(work.points.output, kFeatures);
    for (std::size_t p = begin; p < end; ++p) {
      const float inverse = inverse_opacity(pixels.opacity(p));
      for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) {
        const float weight = pixels.weights[s] * inverse;
        for (int c = 0; c < kFeatures; ++c) {
          composited.at(p - begin, c) += weight * features.at(s - first, c);
        }
      }
      composited.at(p - begin, kFeatures) = 1.0f;
    }
    ensure_size(work.logits, groups * kHeadOutputs * kGroup);
    head_.forward({{work.composited.data(), kHeadInputs}, {work.logits.data(), kHeadOutputs}}, groups);
  }

  /// Loss of one pixel; writes the gradient times `scale`.
  static double loss_gradient(Work& work, std::size_t pixel, const SoftLabel& label, float regression, float scale) {
    ensure_size(work.d_logits, work.logits.size());
    const GroupedView<const float> logits(work.logits, kHeadOutputs);
    const GroupedView<float> d(work.d_logits, kHeadOutputs);  // exponentials, then probabilities, then the gradient
    float largest = logits.at(pixel, 0);
    for (int q = 1; q < kAbBinCount; ++q) largest = std::max(largest, logits.at(pixel, q));
    float sum = 0;
    for (int q = 0; q < kAbBinCount; ++q) {
      const float e = Softmax::exponential(logits.at(pixel, q), largest);
      d.at(pixel, q) = e;
      sum += e;
    }
    const Softmax softmax(largest, sum);
    for (int q = 0; q < kAbBinCount; ++q) d.at(pixel, q) = softmax.probability(d.at(pixel, q));

    MeanError mean;
    if (regression > 0) mean = {mean_of_bins(d, pixel), mean_of(label), regression};
    double loss = regression * double(mean.cost);
    const std::array<Ab, kAbBinCount>& centres = ab_bin_centres();
    for (int q = 0; q < kAbBinCount; ++q) {
      float& p = d.at(pixel, q);
      p = logit_gradient(p, regression > 0 ? mean.by_logit(p, centres[std::size_t(q)]) : 0, scale);
    }
    for (int i = 0; i < kSoftLabelBins; ++i) {
      const float z = label.weight[i];
      if (z <= 0) continue;
      loss += divergence(z, softmax.log_probability(logits.at(pixel, label.bin[i])));
      d.at(pixel, label.bin[i]) += label_gradient(z, scale);
    }
    for (int pad = kAbBinCount; pad < kHeadOutputs; ++pad) d.at(pixel, pad) = 0;
    return loss;
  }

  /// Mean colour of a pixel's distribution.
  static Ab mean_of_bins(const GroupedView<float>& probabilities, std::size_t pixel) {
    const std::array<Ab, kAbBinCount>& centres = ab_bin_centres();
    Ab mean;
    for (int q = 0; q < kAbBinCount; ++q) {
      const float p = probabilities.at(pixel, q);
      mean.a += p * centres[std::size_t(q)].a;
      mean.b += p * centres[std::size_t(q)].b;
    }
    return mean;
  }

  static void clear_padding(Work& work, std::size_t pixels) {
    const std::size_t lanes = groups_of(pixels) * kGroup;
    for (std::size_t p = pixels; p < lanes; ++p) {
      for (int q = 0; q < kHeadOutputs; ++q) GroupedView<float>(work.d_logits, kHeadOutputs).at(p, q) = 0;
    }
  }

  /// Returns the sum of the pixels' spreads.
  double backward(const PixelSamples& pixels, std::size_t begin, std::size_t end, float spread_slope, Work& work,
                  StepChunk& chunk) const {
    ensure_size(work.d_composited, work.composited.size());
    head_.backward({{work.composited.data(), kHeadInputs}, {work.logits.data(), kHeadOutputs}},
                   {{work.d_composited.data(), kHeadInputs}, {work.d_logits.data(), kHeadOutputs}},
                   groups_of(end - begin), chunk.d_weights.data() + features_.weight_count());
    const std::size_t first = pixels.offsets[begin];
    std::fill(work.points.d_output.begin(), work.points.d_output.end(), 0.0f);
    const GroupedView<const float> features(work.points.output, kFeatures);
    const GroupedView<float> d_features(work.points.d_output, kFeatures);
    const GroupedView<const float> composited(work.composited, kHeadInputs);
    const GroupedView<const float> d_composited(work.d_composited, kHeadInputs);
    double spread = 0;
    for (std::size_t p = begin; p < end; ++p) {
      const float inverse = inverse_opacity(pixels.opacity(p));
      for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) {
        const float share = pixels.weights[s] * inverse;
        float squared_distance = 0;
        for (int c = 0; c < kFeatures; ++c) {
          const float distance = features.at(s - first, c) - composited.at(p - begin, c);
          squared_distance += distance * distance;
          d_features.at(s - first, c) = share * (d_composited.at(p - begin, c) + spread_slope * distance);
        }
        spread += double(share * squared_distance);
      }
    }
    float* d_encoded = chunk.append(work.points.positions, work.points.groups, features_.encoded_channels());
    features_.backward(work.points, d_encoded, chunk.d_weights.data());
    return spread;
  }

  PointNetCpu features_;
  MlpCpu head_;
  StepShare share_;
  StepChunks chunks_;
  mutable tbb::enumerable_thread_specific<Work> works_;
};

}  // namespace

std::unique_ptr<ColorBinEngine> make_cpu_color_bin_engine(const HashGridOptions& grid, std::uint64_t seed) {
  return std::make_unique<ColorBinEngineCpu>(grid, seed);
}

}  // namespace cnerf
