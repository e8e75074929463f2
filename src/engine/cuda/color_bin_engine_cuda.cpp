#include <algorithm>
#include <mutex>

#include "src/base/check.h"
#include "src/engine/color_engines.h"
#include "src/engine/cuda/chroma_stream.h"
#include "src/engine/cuda/pixel_batch.h"
#include "src/engine/cuda/traced_pixels.h"
#include "src/field/cuda/point_net.h"
#include "src/field/nets.h"

namespace cnerf {
namespace {

constexpr std::size_t kPixelsAtATime = 1 << 14;  // that are asked about

class ColorBinEngineCuda final : public ColorBinEngine {
 public:
  ColorBinEngineCuda(const HashGridOptions& grid, std::uint64_t seed)
      : features_(grid, PointOutputs::kFeatures, seed),
        head_(initial_chroma_head(seed)),
        packed_head_(chroma_head_weight_count()) {
    state_loaded();
  }

  void share_steps(const StepShare& share) override {
    check_sums(share);
    share_ = share;
  }
  double fit(const PixelSamples& pixels, std::span<const SoftLabel> labels, std::span<const float> pixel_weights,
             const ChromaLossWeights& more, float learning_rate) override {
    const std::lock_guard lock(mutex_);
    const auto [own, last] = share_.range(pixels.pixels(), kPixelsPerBlock);
    const std::size_t n = last - own;
    batch_.upload(pixels, own, last, stream_);
    stream_.begin_step(learning_rate, step_count(), batch_.samples());
    labels_.reserve(n, "labels");
    labels_.upload(labels.data() + own, n, stream_);
    if (!pixel_weights.empty()) pixel_weights = pixel_weights.subspan(own, n);
    d_composited_.reserve(n * kChromaFeatures, "pixels");
    int parts = chroma_head_parts(batch_.arrays().pixels);
    d_head_.reserve(std::size_t(std::max(1, parts)) * std::size_t(chroma_head_weight_count()), "nets");

    features_.forward(batch_.arrays().positions, batch_.samples(), /*for_training=*/true, stream_);
    const float scale = 1.0f / float(pixels.pixels());
    chroma_loss(head_job(),
                {labels_.data(), batch_.upload_weights(pixel_weights, stream_), centres_.data(), scale, more.spread,
                 more.regression, d_composited_.data(), d_head_.data(), &stream_.step()->loss},
                stream_);
    features_.backward(batch_.arrays().places, {&stream_.step()->samples, batch_.samples()},
                       {batch_.arrays().shares, d_composited_.data(), spread_slope(more.spread, scale)}, stream_);
    if (!share_.is_whole()) {
      sum_gradient_parts(d_head_.data(), parts, chroma_head_weight_count(), *share_.on_device, stream_);
      parts = 1;
    }
    update_head(d_head_.data(), parts);
    features_.update(&stream_.step()->adam, share_.on_device, stream_);
    return stream_.end_step(share_.on_device) * scale;
  }

  void logits(const PixelSamples& pixels, std::span<float> logits) const override {
    CNERF_CHECK_EQ(logits.size(), pixels.pixels() * kAbBinCount);
    for_pieces(pixels, [&](std::size_t begin, std::size_t count) {
      logits_.reserve(count * kAbBinCount, "logits");
      chroma_logits(head_job(), logits_.data(), stream_);
      logits_.download(logits.data() + begin * kAbBinCount, count * kAbBinCount, stream_);
    });
  }
  void decode(const PixelSamples& pixels, float temperature, std::span<Ab> colors) const override {
    CNERF_CHECK_EQ(colors.size(), pixels.pixels());
    for_pieces(pixels, [&](std::size_t begin, std::size_t count) {
      colors_.reserve(count, "pixels");
      chroma_colors(head_job(), {temperature, centres_.data(), colors_.data()}, stream_);
      colors_.download(colors.data() + begin, count, stream_);
    });
  }
  void decode_traced(const TracedPixels& pixels, float temperature, std::span<Ab> colors) const override {
    const auto* here = dynamic_cast<const TracedPixelsCuda*>(&pixels);
    if (here == nullptr) return decode(pixels.samples(), temperature, colors);
    CNERF_CHECK_EQ(colors.size(), pixels.results().size());
    const std::lock_guard lock(mutex_);
    batch_.refer_to(here->buffers(), stream_);
    features_.forward(batch_.arrays().positions, batch_.samples(), /*for_training=*/false, stream_);
    colors_.reserve(colors.size(), "pixels");
    chroma_colors(head_job(), {temperature, centres_.data(), colors_.data()}, stream_);
    colors_.download(colors.data(), colors.size(), stream_);
    stream_.wait();
  }

  [[nodiscard]] std::vector<StatePiece> state() override {
    const std::lock_guard lock(mutex_);
    std::vector<StatePiece> state;
    features_.append_state("features", state);
    head_.append_state("head", state);
    state.push_back(steps_piece("chroma_steps"));
    return state;
  }
  void state_loaded() override {
    const std::lock_guard lock(mutex_);
    features_.upload(stream_);
    head_.upload();
    update_head(nullptr, 0);
    stream_.wait();
  }

 private:
  /// Composites features of some pixels at a time and calls `work(first pixel, count)`.
  template <typename Work>
  void for_pieces(const PixelSamples& pixels, Work&& work) const {
    const std::lock_guard lock(mutex_);
    for (std::size_t begin = 0; begin < pixels.pixels(); begin += kPixelsAtATime) {
      const std::size_t end = std::min(begin + kPixelsAtATime, pixels.pixels());
      batch_.upload(pixels, begin, end, stream_);
      features_.forward(batch_.arrays().positions, batch_.samples(), /*for_training=*/false, stream_);
      work(begin, end - begin);
      stream_.wait();
    }
  }
  [[nodiscard]] ChromaHeadJob head_job() const {
    return {batch_.arrays(), features_.features(), packed_head_.weights()};
  }
  /// @param gradient  null: only packs the weights
  void update_head(const float* gradient, int parts) const {
    update_layers({chroma_head_layer(head_.weights(), packed_head_.weights())}, gradient, parts, &stream_.step()->adam,
                  stream_);
  }

  StepShare share_;
  ChromaStream stream_;
  mutable PointNetCuda features_;
  TrainedNet head_;
  PackedBuffers packed_head_;
  DeviceBuffer<float> d_head_, d_composited_;
  DeviceBuffer<SoftLabel> labels_;
  mutable PixelBatch batch_;
  DeviceBuffer<Ab> centres_ = uploaded(std::vector<Ab>(ab_bin_centres().begin(), ab_bin_centres().end()), "bins");
  mutable DeviceBuffer<float> logits_;
  mutable DeviceBuffer<Ab> colors_;
  mutable std::mutex mutex_;  // pixels are decoded from many threads
};

}  // namespace

std::unique_ptr<ColorBinEngine> make_cuda_color_bin_engine(const HashGridOptions& grid, std::uint64_t seed) {
  return std::make_unique<ColorBinEngineCuda>(grid, seed);
}

}  // namespace cnerf
