#include <mutex>

#include "src/base/check.h"
#include "src/engine/color_engines.h"
#include "src/engine/cuda/chroma_stream.h"
#include "src/engine/cuda/pixel_batch.h"
#include "src/field/cuda/point_net.h"

namespace cnerf {
namespace {

constexpr std::size_t kFieldPixelsAtATime = 1 << 16;
constexpr std::size_t kPointsAtATime = 1 << 20;

class ColorFieldEngineCuda final : public ColorFieldEngine {
 public:
  ColorFieldEngineCuda(const HashGridOptions& grid, std::uint64_t seed) : field_(grid, PointOutputs::kNumbers, seed) {
    state_loaded();
  }

  void share_steps(const StepShare& share) override {
    check_sums(share);
    share_ = share;
  }
  double fit(const PixelSamples& pixels, std::span<const Ab> targets, std::span<const float> pixel_weights, AbLoss loss,
             float learning_rate) override {
    const std::lock_guard lock(mutex_);
    const auto [own, last] = share_.range(pixels.pixels(), kPixelsPerBlock);
    const std::size_t n = last - own;
    batch_.upload(pixels, own, last, stream_);
    stream_.begin_step(learning_rate, step_count(), batch_.samples());
    colors_.reserve(n, "pixels");
    colors_.upload(targets.data() + own, n, stream_);
    if (!pixel_weights.empty()) pixel_weights = pixel_weights.subspan(own, n);
    d_logs_.reserve(batch_.samples(), "samples");

    field_.forward(batch_.arrays().positions, batch_.samples(), /*for_training=*/true, stream_);
    const float scale = 1.0f / float(pixels.pixels());
    chromaticity_loss(batch_.arrays(), field_.numbers(),
                      {colors_.data(), batch_.upload_weights(pixel_weights, stream_), loss, scale, d_logs_.data(),
                       &stream_.step()->loss},
                      stream_);
    field_.backward(batch_.arrays().places, {&stream_.step()->samples, batch_.samples()}, {.d_numbers = d_logs_.data()},
                    stream_);
    field_.update(&stream_.step()->adam, share_.on_device, stream_);
    return stream_.end_step(share_.on_device) * scale;
  }

  void composite(const PixelSamples& pixels, std::span<Ab> colors) const override {
    CNERF_CHECK_EQ(colors.size(), pixels.pixels());
    const std::lock_guard lock(mutex_);
    for (std::size_t begin = 0; begin < pixels.pixels(); begin += kFieldPixelsAtATime) {
      const std::size_t end = std::min(begin + kFieldPixelsAtATime, pixels.pixels());
      batch_.upload(pixels, begin, end, stream_);
      composite_batch(colors.subspan(begin, end - begin));
    }
  }
  void composite_traced(const TracedPixels& pixels, std::span<Ab> colors) const override {
    const auto* here = dynamic_cast<const TracedPixelsCuda*>(&pixels);
    if (here == nullptr) return composite(pixels.samples(), colors);
    CNERF_CHECK_EQ(colors.size(), pixels.results().size());
    const std::lock_guard lock(mutex_);
    batch_.refer_to(here->buffers(), stream_);
    composite_batch(colors);
  }

  void query(std::span<const Vec3f> positions, std::span<Chromaticity> chromaticity) const override {
    CNERF_CHECK_EQ(positions.size(), chromaticity.size());
    const std::lock_guard lock(mutex_);
    for (std::size_t first = 0; first < positions.size(); first += kPointsAtATime) {
      const std::size_t count = std::min(kPointsAtATime, positions.size() - first);
      points_.reserve(count, "points");
      ratios_.reserve(count, "points");
      points_.upload(positions.data() + first, count, stream_);
      field_.forward(points_.data(), std::uint32_t(count), /*for_training=*/false, stream_);
      chromaticity_of_logs(field_.numbers(), std::uint32_t(count), ratios_.data(), stream_);
      ratios_.download(chromaticity.data() + first, count, stream_);
      stream_.wait();
    }
  }

  [[nodiscard]] std::vector<StatePiece> state() override {
    const std::lock_guard lock(mutex_);
    std::vector<StatePiece> state;
    field_.append_state("chromaticity", state);
    state.push_back(steps_piece("chromaticity_steps"));
    return state;
  }
  void state_loaded() override {
    const std::lock_guard lock(mutex_);
    field_.upload(stream_);
    stream_.wait();
  }

 private:
  void composite_batch(std::span<Ab> colors) const {
    field_.forward(batch_.arrays().positions, batch_.samples(), /*for_training=*/false, stream_);
    colors_.reserve(colors.size(), "pixels");
    composite_chromaticity(batch_.arrays(), field_.numbers(), colors_.data(), stream_);
    colors_.download(colors.data(), colors.size(), stream_);
    stream_.wait();
  }

  StepShare share_;
  ChromaStream stream_;
  mutable PointNetCuda field_;
  DeviceBuffer<float2> d_logs_;
  mutable PixelBatch batch_;
  mutable DeviceBuffer<Ab> colors_;
  mutable DeviceBuffer<Vec3f> points_;
  mutable DeviceBuffer<Chromaticity> ratios_;
  mutable std::mutex mutex_;  // bakes query from many threads
};

}  // namespace

std::unique_ptr<ColorFieldEngine> make_cuda_color_field_engine(const HashGridOptions& grid, std::uint64_t seed) {
  return std::make_unique<ColorFieldEngineCuda>(grid, seed);
}

}  // namespace cnerf
