#include <tbb/enumerable_thread_specific.h>

#include <cmath>

#include "src/base/check.h"
#include "src/engine/color_engines.h"
#include "src/engine/cpu/step_chunks.h"
#include "src/field/cpu/point_net.h"
#include "src/field/nets.h"

namespace cnerf {
namespace {

class ColorFieldEngineCpu final : public ColorFieldEngine {
 public:
  ColorFieldEngineCpu(const HashGridOptions& grid, std::uint64_t seed)
      : field_(grid, kChromaticityOutputs, /*relu_output=*/false, seed) {}

  void share_steps(const StepShare& share) override { share_ = share; }
  double fit(const PixelSamples& pixels, std::span<const Ab> targets, std::span<const float> pixel_weights, AbLoss loss,
             float learning_rate) override {
    const float scale = 1.0f / float(pixels.pixels());
    const auto [own, last] = share_.range(pixels.pixels(), kPixelsPerBlock);
    chunks_.run(last - own, kPixelsPerBlock, field_.weight_count(),
                [&, shift = own](StepChunk& chunk, std::size_t from, std::size_t to) {
                  const std::size_t begin = shift + from, end = shift + to;
                  PointWorkspace& work = works_.local();
                  const std::size_t first = forward(pixels, begin, end, work);
                  std::fill(work.d_output.begin(), work.d_output.end(), 0.0f);
                  for (std::size_t p = begin; p < end; ++p) {
                    const float weight = pixel_weights.empty() ? 1.0f : pixel_weights[p];
                    const AbError error = ab_error(xyz_of(pixels, p, first, work), targets[p], loss, weight * scale);
                    set_gradient(pixels, p, first, error, work);
                    chunk.loss += error.distance;
                  }
                  float* d_encoded = chunk.append(work.positions, work.groups, field_.encoded_channels());
                  field_.backward(work, d_encoded, chunk.d_weights.data());
                });
    const auto [d_weights, total] = chunks_.sums(share_);
    field_.update(chunks_.runs(), d_weights, learning_rate, step_count(), share_.sum);
    return total * scale;
  }

  void composite(const PixelSamples& pixels, std::span<Ab> colors) const override {
    CNERF_CHECK_EQ(colors.size(), pixels.pixels());
    parallel_ranges(pixels.pixels(), kPixelsPerBlock, [&](std::size_t begin, std::size_t end) {
      PointWorkspace& work = works_.local();
      const std::size_t first = forward(pixels, begin, end, work);
      for (std::size_t p = begin; p < end; ++p) colors[p] = ab_of(xyz_of(pixels, p, first, work));
    });
  }

  void query(std::span<const Vec3f> positions, std::span<Chromaticity> chromaticity) const override {
    CNERF_CHECK_EQ(positions.size(), chromaticity.size());
    constexpr std::size_t kPiece = 512;
    PointWorkspace& work = works_.local();
    for (std::size_t first = 0; first < positions.size(); first += kPiece) {
      const std::size_t count = std::min(kPiece, positions.size() - first);
      field_.set_points(positions.subspan(first, count), work);
      field_.forward(work);
      const GroupedView<const float> logs(work.output, kChromaticityOutputs);
      for (std::size_t i = 0; i < count; ++i) {
        chromaticity[first + i] = {ratio_of(logs.at(i, 0)), ratio_of(logs.at(i, 1))};
      }
    }
  }

  [[nodiscard]] std::vector<StatePiece> state() override {
    std::vector<StatePiece> state;
    field_.append_state("chromaticity", state);
    state.push_back(steps_piece("chromaticity_steps"));
    return state;
  }
  void state_loaded() override { field_.state_loaded(); }

 private:
  std::size_t forward(const PixelSamples& pixels, std::size_t begin, std::size_t end, PointWorkspace& work) const {
    const std::size_t first = pixels.offsets[begin];
    field_.set_points(std::span(pixels.positions).subspan(first, pixels.offsets[end] - first), work);
    field_.forward(work);
    return first;
  }

  [[nodiscard]] PixelXyz xyz_of(const PixelSamples& pixels, std::size_t p, std::size_t first,
                                const PointWorkspace& work) const {
    const GroupedView<const float> logs(work.output, kChromaticityOutputs);
    PixelXyz sum;
    for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) {
      const float light = pixels.weights[s] * pixels.luminance[s];
      sum.x += light * ratio_of(logs.at(s - first, 0));
      sum.y += light;
      sum.z += light * ratio_of(logs.at(s - first, 1));
    }
    return sum;
  }

  /// Sets the gradient of the outputs of a pixel's samples.
  static void set_gradient(const PixelSamples& pixels, std::size_t p, std::size_t first, const AbError& error,
                           PointWorkspace& work) {
    const GroupedView<const float> logs(work.output, kChromaticityOutputs);
    const GroupedView<float> d_logs(work.d_output, kChromaticityOutputs);
    for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) {
      const float light = pixels.weights[s] * pixels.luminance[s];
      d_logs.at(s - first, 0) = error.d_x * light * ratio_derivative(logs.at(s - first, 0));
      d_logs.at(s - first, 1) = error.d_z * light * ratio_derivative(logs.at(s - first, 1));
    }
  }

  PointNetCpu field_;
  StepShare share_;
  StepChunks chunks_;
  mutable tbb::enumerable_thread_specific<PointWorkspace> works_;
};

}  // namespace

std::unique_ptr<ColorFieldEngine> make_cpu_color_field_engine(const HashGridOptions& grid, std::uint64_t seed) {
  return std::make_unique<ColorFieldEngineCpu>(grid, seed);
}

}  // namespace cnerf
