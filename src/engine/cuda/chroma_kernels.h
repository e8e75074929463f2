#pragma once
/// Kernels of stage 2: compositing of the samples of pixels, losses and gradients.

#include <cuda_runtime_api.h>

#include <cstdint>
#include <vector>

#include "src/base/vec3.h"
#include "src/engine/chroma_math.h"
#include "src/field/color_field.h"
#include "src/field/cuda/dense_layer.h"

namespace cnerf {

/// PixelSamples (color_engines.h) in device memory.
struct PixelArrays {
  std::uint32_t pixels = 0;
  const Vec3f* positions = nullptr;
  const float* weights = nullptr;
  const float* luminance = nullptr;
  const std::uint32_t *begins = nullptr, *ends = nullptr;  ///< [pixels] of their samples
  // Made of these by `prepare_samples`:
  float4* places = nullptr;  ///< positions clamped to [0, 1], and the bits of the pixel's number
  float* shares = nullptr;   ///< w / A: of its pixel's features; 0 in pixels without colour
};

/// Input and result of a step, in device memory.
struct ChromaStep {
  AdamStep adam;
  std::uint32_t samples = 0;
  double loss = 0;  ///< sum over pixels
};

void prepare_samples(const PixelArrays& pixels, cudaStream_t stream);

/// The linear head: 64 composited features and a constant to 313 logits. It works on 16 pixels per block.
struct ChromaHeadJob {
  PixelArrays pixels;
  const std::uint32_t* features;  ///< [samples, 64] halves
  PackedWeights weights;
};
/// @param logits  [pixels, 313], written
void chroma_logits(const ChromaHeadJob& job, float* logits, cudaStream_t stream);

struct ChromaDecoding {
  float temperature;  ///< 0: the most probable bin, of equals the first
  const Ab* centres;  ///< [313] of the bins
  Ab* colors;         ///< [pixels], written
};
void chroma_colors(const ChromaHeadJob& job, const ChromaDecoding& decoding, cudaStream_t stream);

struct ChromaTargets {
  const SoftLabel* labels;     ///< [pixels]
  const float* pixel_weights;  ///< [pixels]
  const Ab* centres;           ///< [313] of the bins
  float scale;                 ///< of the gradient
  float spread_weight;         ///< of the pixels' spreads in the loss
  float regression_weight;     ///< of the cost of the pixels' means in the loss
  float* d_composited;         ///< [pixels, 64], written: for features h it lacks spread_slope() h
  float* d_weights;            ///< [chroma_head_parts(pixels), chroma_head_weight_count()], written
  double* loss;                ///< added to
};
/// Softmax, its cross entropy with the labels, the cost of its mean, the spread, and their gradient, in one kernel.
void chroma_loss(const ChromaHeadJob& job, const ChromaTargets& targets, cudaStream_t stream);

[[nodiscard]] int chroma_head_parts(std::uint32_t pixels);
[[nodiscard]] int chroma_head_weight_count();
/// @param packed  [chroma_head_weight_count()]
[[nodiscard]] DenseLayer chroma_head_layer(TrainedWeights trained, PackedWeights packed);

/// ab of the pixels' composited XYZ.
/// @param logs    [samples] log x, log z
/// @param colors  [pixels], written
void composite_chromaticity(const PixelArrays& pixels, const float2* logs, Ab* colors, cudaStream_t stream);

struct ChromaticityTargets {
  const Ab* colors;            ///< [pixels]
  const float* pixel_weights;  ///< [pixels]
  AbLoss kind;
  float scale;     ///< of the gradient
  float2* d_logs;  ///< [samples], written
  double* loss;    ///< ab distances, added to
};
void chromaticity_loss(const PixelArrays& pixels, const float2* logs, const ChromaticityTargets& targets,
                       cudaStream_t stream);

/// @param ratios  [count], written
void chromaticity_of_logs(const float2* logs, std::uint32_t count, Chromaticity* ratios, cudaStream_t stream);

}  // namespace cnerf
