#include <tbb/enumerable_thread_specific.h>

#include <array>
#include <cmath>

#include "src/base/check.h"
#include "src/engine/chroma_state.h"
#include "src/engine/color_engines.h"
#include "src/engine/cpu/point_net.h"
#include "src/engine/cpu/step_chunks.h"
#include "src/engine/initial_state.h"

namespace cnerf {
namespace {

constexpr int kFeatures = kChromaFeatures;
constexpr int kHeadInputs = kChromaHeadInputs;
constexpr int kHeadOutputs = kChromaHeadOutputs;
constexpr std::size_t kBlockPixels = 64;  // four groups: their logits stay in L2

class ColorBinEngineCpu final : public ColorBinEngine {
 public:
  ColorBinEngineCpu(const HashGridOptions& grid, std::uint64_t seed)
      : features_(grid, kFeatures, /*relu_output=*/true, seed),
        head_({{kHeadInputs, kHeadOutputs}}, seed, kChromaHeadStream) {
    head_.set_weights(initial_chroma_head(seed));
  }

  using ColorBinEngine::step;
  double step(const PixelSamples& pixels, std::span<const SoftLabel> labels, std::span<const float> pixel_weights,
              const ChromaLossWeights& more, float learning_rate) override {
    CNERF_CHECK_EQ(labels.size(), pixels.pixels());
    const float scale = 1.0f / float(pixels.pixels());
    chunks_.run(pixels.pixels(), kBlockPixels, features_.weight_count() + head_.layout().weight_count(),
                [&](StepChunk& chunk, std::size_t begin, std::size_t end) {
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
    steps_.front() += 1;
    const std::vector<float> d_weights = chunks_.d_weights();
    const auto split = std::ptrdiff_t(features_.weight_count());
    features_.update(chunks_.runs(), {d_weights.begin(), d_weights.begin() + split}, learning_rate, steps_.front());
    const AdamSettings adam;
    head_.update({d_weights.begin() + split, d_weights.end()}, adam, AdamStep(adam, learning_rate, steps_.front()));
    return chunks_.loss() * scale;
  }

  void logits(const PixelSamples& pixels, std::span<float> logits) const override {
    CNERF_CHECK_EQ(logits.size(), pixels.pixels() * kAbBinCount);
    parallel_ranges(pixels.pixels(), kBlockPixels, [&](std::size_t begin, std::size_t end) {
      Work& work = works_.local();
      forward(pixels, begin, end, work);
      for (std::size_t p = begin; p < end; ++p) {
        for (int q = 0; q < kAbBinCount; ++q) logits[p * kAbBinCount + q] = work.logits[logit_at(p - begin, q)];
      }
    });
  }

  void decode(const PixelSamples& pixels, float temperature, std::span<Ab> colors) const override {
    CNERF_CHECK_EQ(colors.size(), pixels.pixels());
    parallel_ranges(pixels.pixels(), kBlockPixels, [&](std::size_t begin, std::size_t end) {
      Work& work = works_.local();
      forward(pixels, begin, end, work);
      std::array<float, kAbBinCount> of_pixel;
      for (std::size_t p = begin; p < end; ++p) {
        for (int q = 0; q < kAbBinCount; ++q) of_pixel[std::size_t(q)] = work.logits[logit_at(p - begin, q)];
        colors[p] = temperature > 0 ? decode_annealed_mean(of_pixel, temperature) : decode_arg_max(of_pixel);
      }
    });
  }

  [[nodiscard]] long step_count() const override { return steps_.front(); }
  [[nodiscard]] std::vector<StatePiece> state() override { return chroma_state(features_, head_, steps_); }
  void state_loaded() override {
    features_.state_loaded();
    head_.transpose_weights();
  }

 private:
  struct Work {
    PointWorkspace points;
    AlignedVector<float> composited, logits, d_composited, d_logits;  // pixels as lanes
  };

  static std::size_t logit_at(std::size_t pixel, int bin) {
    return (pixel / kGroup * kHeadOutputs + std::size_t(bin)) * kGroup + pixel % kGroup;
  }
  static std::size_t head_input_at(std::size_t pixel, int channel) {
    return (pixel / kGroup * kHeadInputs + std::size_t(channel)) * kGroup + pixel % kGroup;
  }
  static float inverse_opacity_of(const PixelSamples& pixels, std::size_t p) {
    float opacity = 0;
    for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) opacity += pixels.weights[s];
    return inverse_opacity(opacity);
  }

  void forward(const PixelSamples& pixels, std::size_t begin, std::size_t end, Work& work) const {
    const std::size_t first = pixels.offsets[begin];
    features_.set_points(std::span(pixels.positions).subspan(first, pixels.offsets[end] - first), work.points);
    features_.forward(work.points);

    const std::size_t groups = (end - begin + kGroup - 1) / kGroup;
    ensure_size(work.composited, groups * kHeadInputs * kGroup);
    std::fill_n(work.composited.begin(), groups * kHeadInputs * kGroup, 0.0f);
    for (std::size_t p = begin; p < end; ++p) {
      const float inverse = inverse_opacity_of(pixels, p);
      for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) {
        const float weight = pixels.weights[s] * inverse;
        for (int c = 0; c < kFeatures; ++c) {
          work.composited[head_input_at(p - begin, c)] +=
              weight * work.points.output[features_.output_at(s - first, c)];
        }
      }
      work.composited[head_input_at(p - begin, kFeatures)] = 1.0f;
    }
    ensure_size(work.logits, groups * kHeadOutputs * kGroup);
    head_.forward({{work.composited.data(), kHeadInputs}, {work.logits.data(), kHeadOutputs}}, groups);
  }

  /// KL(label || softmax(logits)) of one pixel and the cost of its mean; writes the gradient times `scale`.
  static double loss_gradient(Work& work, std::size_t pixel, const SoftLabel& label, float regression, float scale) {
    ensure_size(work.d_logits, work.logits.size());
    float largest = work.logits[logit_at(pixel, 0)];
    for (int q = 1; q < kAbBinCount; ++q) largest = std::max(largest, work.logits[logit_at(pixel, q)]);
    float sum = 0;
    for (int q = 0; q < kAbBinCount; ++q) {
      const float e = std::exp(work.logits[logit_at(pixel, q)] - largest);
      work.d_logits[logit_at(pixel, q)] = e;
      sum += e;
    }
    double loss = 0;
    for (int q = 0; q < kAbBinCount; ++q) work.d_logits[logit_at(pixel, q)] /= sum;
    if (regression > 0) loss += regression * add_mean_gradient(work, pixel, mean_of(label), regression);
    for (int q = 0; q < kAbBinCount; ++q) work.d_logits[logit_at(pixel, q)] *= scale;
    for (int i = 0; i < kSoftLabelBins; ++i) {
      const std::size_t at = logit_at(pixel, label.bin[i]);
      const float z = label.weight[i];
      if (z <= 0) continue;
      loss += divergence(z, work.logits[at] - largest - std::log(sum));
      work.d_logits[at] -= scale * z;
    }
    for (int pad = kAbBinCount; pad < kHeadOutputs; ++pad) work.d_logits[logit_at(pixel, pad)] = 0;
    return loss;
  }

  /// Cost of the mean of the pixel's probabilities, which lie where its gradient by the logits goes: adds to them the
  /// cost's derivative times `weight`.
  static double add_mean_gradient(Work& work, std::size_t pixel, Ab wanted, float weight) {
    const std::array<Ab, kAbBinCount>& centres = ab_bin_centres();
    Ab mean;
    for (int q = 0; q < kAbBinCount; ++q) {
      const float p = work.d_logits[logit_at(pixel, q)];
      mean.a += p * centres[std::size_t(q)].a;
      mean.b += p * centres[std::size_t(q)].b;
    }
    const Ab away = {mean.a - wanted.a, mean.b - wanted.b};
    const Ab d_mean = {weight * mean_slope(away.a), weight * mean_slope(away.b)};
    for (int q = 0; q < kAbBinCount; ++q) {
      float& p = work.d_logits[logit_at(pixel, q)];
      p += logit_slope(p, centres[std::size_t(q)], mean, d_mean);
    }
    return mean_cost(away.a) + mean_cost(away.b);
  }

  static void clear_padding(Work& work, std::size_t pixels) {
    const std::size_t lanes = (pixels + kGroup - 1) / kGroup * kGroup;
    for (std::size_t p = pixels; p < lanes; ++p) {
      for (int q = 0; q < kHeadOutputs; ++q) work.d_logits[logit_at(p, q)] = 0;
    }
  }

  /// Returns the sum of the pixels' spreads.
  double backward(const PixelSamples& pixels, std::size_t begin, std::size_t end, float spread_slope, Work& work,
                  StepChunk& chunk) const {
    ensure_size(work.d_composited, work.composited.size());
    head_.backward({{work.composited.data(), kHeadInputs}, {work.logits.data(), kHeadOutputs}},
                   {{work.d_composited.data(), kHeadInputs}, {work.d_logits.data(), kHeadOutputs}},
                   (end - begin + kGroup - 1) / kGroup, chunk.d_weights.data() + features_.weight_count());
    const std::size_t first = pixels.offsets[begin];
    std::fill(work.points.d_output.begin(), work.points.d_output.end(), 0.0f);
    double spread = 0;
    for (std::size_t p = begin; p < end; ++p) {
      const float inverse = inverse_opacity_of(pixels, p);
      for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) {
        const float share = pixels.weights[s] * inverse;
        float squared_distance = 0;
        for (int c = 0; c < kFeatures; ++c) {
          const std::size_t of_sample = features_.output_at(s - first, c), of_pixel = head_input_at(p - begin, c);
          const float distance = work.points.output[of_sample] - work.composited[of_pixel];
          squared_distance += distance * distance;
          work.points.d_output[of_sample] = share * (work.d_composited[of_pixel] + spread_slope * distance);
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
  StepChunks chunks_;
  std::vector<std::int64_t> steps_ = {0};
  mutable tbb::enumerable_thread_specific<Work> works_;
};

}  // namespace

std::unique_ptr<ColorBinEngine> make_cpu_color_bin_engine(const HashGridOptions& grid, std::uint64_t seed) {
  return std::make_unique<ColorBinEngineCpu>(grid, seed);
}

}  // namespace cnerf
