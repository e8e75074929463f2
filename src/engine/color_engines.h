#pragma once
/// The engines of stage 2, on frozen geometry: a distribution over the 313 ab bins per pixel, and the colour per sample
/// that a bake needs.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "encoding/hash_grid_levels.h"
#include "src/color/ab_bins.h"
#include "src/engine/chroma_math.h"
#include "src/engine/pixel_samples.h"
#include "src/engine/step_share.h"
#include "src/field/color_field.h"
#include "src/field/state.h"

namespace cnerf {

/// What a step adds to the cross entropy.
struct ChromaLossWeights {
  float spread = 0;      ///< of the mean over pixels of their spread (chroma_math.h)
  float regression = 0;  ///< of the mean over pixels of how far the distribution's mean colour is from the label's
};

/// What the engines of stage 2 have in common.
class ColorEngine {
 public:
  virtual ~ColorEngine() = default;
  /// As LuminanceEngine::share_steps. All processes are to call `step` with the same pixels.
  virtual void share_steps(const StepShare& share);
  [[nodiscard]] long step_count() const { return steps_.front(); }
  [[nodiscard]] virtual std::vector<StatePiece> state() = 0;
  virtual void state_loaded() = 0;

 protected:
  void count_step() { steps_.front() += 1; }
  [[nodiscard]] StatePiece steps_piece(std::string name) { return state_piece(std::move(name), steps_); }

 private:
  std::vector<std::int64_t> steps_ = {0};
};

/// Classification-based injection (paper, Eq. color classification loss, read as KL(Z || Z_hat), mean over pixels).
/// Hidden features of samples are composited once, a linear head is applied once per pixel: the same as compositing
/// logits, since the head is linear: W sum(w h) / A + b = sum(w (W h + b)) / A.
class ColorBinEngine : public ColorEngine {
 public:
  /// One optimiser step; returns the mean loss. One of no pixels only counts, and costs 0.
  /// @param labels         [R] soft labels of the pixels
  /// @param pixel_weights  [R] factors of the pixels' losses (opacity, how sure answers are); empty = all 1
  double step(const PixelSamples& pixels, std::span<const SoftLabel> labels, std::span<const float> pixel_weights,
              const ChromaLossWeights& more, float learning_rate);
  /// @param logits  [R, 313]; of pixels below kLeastColoredOpacity they mean nothing
  virtual void logits(const PixelSamples& pixels, std::span<float> logits) const = 0;
  /// One colour per pixel, of the same pixels: see `decode_annealed_mean`; temperature 0 is `decode_arg_max`.
  virtual void decode(const PixelSamples& pixels, float temperature, std::span<Ab> colors) const = 0;
  /// The same, without a way through the host's memory where the pixels were traced on this engine's device.
  virtual void decode_traced(const TracedPixels& pixels, float temperature, std::span<Ab> colors) const {
    decode(pixels.samples(), temperature, colors);
  }

 protected:
  /// A step of at least one pixel, which is counted already.
  virtual double fit(const PixelSamples& pixels, std::span<const SoftLabel> labels,
                     std::span<const float> pixel_weights, const ChromaLossWeights& more, float learning_rate) = 0;
};

/// Per-sample chromaticity, fitted so that compositing it reproduces the pixels' decoded colours (what is baked is what
/// is seen). XYZ of samples composite linearly, so this is exact for every emission-absorption renderer.
class ColorFieldEngine : public ColorEngine {
 public:
  /// One optimiser step towards target ab values at the pixels' own luminance; returns the mean ab distance.
  /// One of no pixels only counts.
  /// @param pixel_weights  [R] factors of the pixels' losses; empty = all 1
  double step(const PixelSamples& pixels, std::span<const Ab> targets, std::span<const float> pixel_weights,
              AbLoss loss, float learning_rate);
  /// ab of the composited XYZ of each pixel.
  virtual void composite(const PixelSamples& pixels, std::span<Ab> colors) const = 0;
  /// As ColorBinEngine::decode_traced.
  virtual void composite_traced(const TracedPixels& pixels, std::span<Ab> colors) const {
    composite(pixels.samples(), colors);
  }
  virtual void query(std::span<const Vec3f> positions, std::span<Chromaticity> chromaticity) const = 0;

 protected:
  /// As ColorBinEngine::fit.
  virtual double fit(const PixelSamples& pixels, std::span<const Ab> targets, std::span<const float> pixel_weights,
                     AbLoss loss, float learning_rate) = 0;
};

[[nodiscard]] std::unique_ptr<ColorBinEngine> make_cpu_color_bin_engine(const HashGridOptions& grid,
                                                                        std::uint64_t seed);
[[nodiscard]] std::unique_ptr<ColorFieldEngine> make_cpu_color_field_engine(const HashGridOptions& grid,
                                                                            std::uint64_t seed);
/// @throws DeviceError  without a usable GPU, or when its memory does not suffice
[[nodiscard]] std::unique_ptr<ColorBinEngine> make_cuda_color_bin_engine(const HashGridOptions& grid,
                                                                         std::uint64_t seed);
[[nodiscard]] std::unique_ptr<ColorFieldEngine> make_cuda_color_field_engine(const HashGridOptions& grid,
                                                                             std::uint64_t seed);

}  // namespace cnerf
