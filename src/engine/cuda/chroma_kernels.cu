#include "src/engine/cuda/chroma_kernels.h"

#include <type_traits>

#include "src/base/cuda/launch.h"
#include "src/base/cuda/warp.cuh"
#include "src/field/cuda/net_backward.cuh"
#include "src/field/nets.h"

namespace cnerf {
namespace {

// ---- samples of pixels, one warp per pixel --------------------------------------------------------------------------

constexpr int kPixelWarps = 8;

/// Calls `work(pixel)` for the pixels of this warp.
template <typename Work>
__device__ void for_each_pixel(std::uint32_t pixels, Work&& work) {
  for (std::uint32_t p = blockIdx.x * kPixelWarps + threadIdx.x / 32; p < pixels; p += gridDim.x * kPixelWarps) {
    work(p);
  }
}
unsigned pixel_blocks(std::uint32_t pixels) {
  constexpr unsigned kBlocksPerProcessor = 8;
  return std::min(kBlocksPerProcessor * unsigned(multiprocessors()), (pixels + kPixelWarps - 1) / kPixelWarps);
}

__global__ void prepare(const PixelArrays pixels) {
  for_each_pixel(pixels.pixels, [&](std::uint32_t p) {
    const std::uint32_t begin = pixels.begins[p] + threadIdx.x % 32, end = pixels.ends[p];
    float opacity = 0;
    for (std::uint32_t s = begin; s < end; s += 32) opacity += pixels.weights[s];
    const float inverse = inverse_opacity(warp_sum(opacity));
    for (std::uint32_t s = begin; s < end; s += 32) {
      const Vec3f at = pixels.positions[s];
      pixels.places[s] = make_float4(__saturatef(at.x), __saturatef(at.y), __saturatef(at.z), __uint_as_float(p));
      pixels.shares[s] = pixels.weights[s] * inverse;
    }
  });
}

__device__ PixelXyz seen_xyz(const PixelArrays& pixels, std::uint32_t p, const float2* logs) {
  PixelXyz sum;
  for (std::uint32_t s = pixels.begins[p] + threadIdx.x % 32; s < pixels.ends[p]; s += 32) {
    const float light = pixels.weights[s] * pixels.luminance[s];
    sum.x += light * ratio_of(logs[s].x);
    sum.y += light;
    sum.z += light * ratio_of(logs[s].y);
  }
  return {warp_sum(sum.x), warp_sum(sum.y), warp_sum(sum.z)};
}

__global__ void composite(const PixelArrays pixels, const float2* logs, Ab* colors) {
  for_each_pixel(pixels.pixels, [&](std::uint32_t p) {
    const Ab color = ab_of(seen_xyz(pixels, p, logs));
    if (threadIdx.x % 32 == 0) colors[p] = color;
  });
}

__global__ void compare(const PixelArrays pixels, const float2* logs, const ChromaticityTargets targets) {
  double total = 0;
  for_each_pixel(pixels.pixels, [&](std::uint32_t p) {
    const AbError error =
        ab_error(seen_xyz(pixels, p, logs), targets.colors[p], targets.kind, targets.pixel_weights[p] * targets.scale);
    total += error.distance;
    for (std::uint32_t s = pixels.begins[p] + threadIdx.x % 32; s < pixels.ends[p]; s += 32) {
      const float light = pixels.weights[s] * pixels.luminance[s];
      targets.d_logs[s] =
          make_float2(error.d_x * light * ratio_derivative(logs[s].x), error.d_z * light * ratio_derivative(logs[s].y));
    }
  });
  if (threadIdx.x % 32 == 0) atomicAdd(targets.loss, total);
}

__global__ void ratios_of(const float2* logs, std::uint32_t count, Chromaticity* ratios) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i < count) ratios[i] = {ratio_of(logs[i].x), ratio_of(logs[i].y)};
}

// The head ------------------------------------------------------------------------------------------------------------
// A block takes 16 pixels at a time; each of its warps owns 32 logits of all of them, and keeps the gradient of the
// weights behind those in registers until all pixels are done.

constexpr int kWarps = 10;
constexpr int kThreads = 32 * kWarps;
constexpr int kPixels = 16;
constexpr int kOfWarp = 32;  // logits
constexpr int kFeatures = kChromaFeatures;
constexpr int kInputs = kFeatures + 16;  // the constant and padding
constexpr int kOutputs = kOfWarp * kWarps;
constexpr int kHeadWeights = kInputs * kOutputs;
static_assert(kOutputs >= kAbBinCount && kInputs >= kChromaHeadInputs);

struct HeadShared {
  uint2 forward[kHeadWeights / 4];
  uint2 backward[kFeatures * kOutputs / 4];
  // Rows are padded: 8 of them fall into different banks.
  alignas(16) __half composited[kPixels][kInputs + 8];
  alignas(16) __nv_bfloat16 inputs[kPixels][kInputs + 8];  ///< the same
  float2 mean[kPixels][kFeatures / 2];                     ///< the same without the constant: the spread's differences
                                                           ///< are small
  alignas(16) __nv_bfloat16 d_logits[kPixels][kOutputs + 8];
  // What each warp found for the pixels:
  float largest[kWarps][kPixels];
  float sum[3][kWarps][kPixels];
};

/// A lane's share of its warp's logits: of 16-column tile i, 8-column block b, rows g and g + 8, neighbours j.
struct Logits {
  float of[2][2][4];

  __device__ static int column(int i, int b, int j) {
    const int lane = int(threadIdx.x) % 32;
    return int(threadIdx.x) / 32 * kOfWarp + 16 * i + 8 * b + 2 * (lane % 4) + j;
  }
  /// Calls `visit(column, value)` for the columns of row g + 8 half.
  template <typename Visit>
  __device__ void for_row(int half, Visit&& visit) {
#pragma unroll
    for (int n = 0; n < 8; ++n) {
      const int i = n / 4, b = n / 2 % 2, j = n % 2;
      visit(column(i, b, j), of[i][b][2 * half + j]);
    }
  }
};

/// Composites features of the block's pixels; the constant behind them stays. Returns this lane's part of the pixels'
/// spreads.
__device__ float composite_features(const ChromaHeadJob& job, std::uint32_t first, HeadShared& shared) {
  const unsigned lane = threadIdx.x % 32;
  float spread = 0;
  for (unsigned p = threadIdx.x / 32; p < kPixels; p += kWarps) {
    float2 sum = make_float2(0, 0);
    float squares = 0;
    if (first + p < job.pixels.pixels) {
      const std::uint32_t end = job.pixels.ends[first + p];
#pragma unroll 4
      for (std::uint32_t s = job.pixels.begins[first + p]; s < end; ++s) {
        const float share = job.pixels.shares[s];
        const float2 features = floats_of_halves(job.features[std::size_t(s) * (kFeatures / 2) + lane]);
        sum.x += share * features.x;
        sum.y += share * features.y;
        squares += share * (features.x * features.x + features.y * features.y);
      }
    }
    spread += squares - sum.x * sum.x - sum.y * sum.y;
    *reinterpret_cast<std::uint32_t*>(&shared.composited[p][2 * lane]) = Half::pack(sum.x, sum.y);
    *reinterpret_cast<std::uint32_t*>(&shared.inputs[p][2 * lane]) = Bfloat::pack(sum.x, sum.y);
    shared.mean[p][lane] = sum;
  }
  return spread;
}

__device__ void apply_head(const HeadShared& shared, Logits& logits) {
  const unsigned lane = threadIdx.x % 32;
  std::uint32_t in[1][kInputs / 16][4];
#pragma unroll
  for (int k = 0; k < kInputs / 16; ++k) {
    load_operand(in[0][k], &shared.composited[lane % 16][16 * k + 8 * (lane / 16)]);
  }
  dense<Half, 1, kInputs / 16, 2>(
      in, shared.forward + threadIdx.x / 32 * (kOfWarp / 8) * 32,
      [&](int, int i, const float(&sums)[2][4]) {
#pragma unroll
        for (int n = 0; n < 8; ++n) logits.of[i][n / 4][n % 4] = sums[n / 4][n % 4];
      },
      kOutputs / 8);
}

/// Joins what the lanes of a row have, for all lanes of the block that share it.
template <typename Join>
__device__ float of_row(float value, int half, float (&of_warps)[kWarps][kPixels], Join&& join) {
  const unsigned row = threadIdx.x % 32 / 4 + 8 * half;
  value = join(value, __shfl_xor_sync(~0u, value, 1));
  value = join(value, __shfl_xor_sync(~0u, value, 2));
  if (threadIdx.x % 4 == 0) of_warps[threadIdx.x / 32][row] = value;
  __syncthreads();
  value = of_warps[0][row];
#pragma unroll
  for (int w = 1; w < kWarps; ++w) value = join(value, of_warps[w][row]);
  return value;
}
__device__ float largest_of_row(Logits& logits, int half, HeadShared& shared) {
  float largest = -INFINITY;
  logits.for_row(half, [&](int q, float& logit) { largest = q < kAbBinCount ? fmaxf(largest, logit) : largest; });
  return of_row(largest, half, shared.largest, [](float a, float b) { return fmaxf(a, b); });
}
__device__ float sum_of_row(float value, int half, float (&of_warps)[kWarps][kPixels]) {
  return of_row(value, half, of_warps, [](float a, float b) { return a + b; });
}

/// Of one row's distribution: what it costs that its mean is away from the label's.
__device__ MeanError mean_error(const Softmax& softmax, int half, const SoftLabel& label, const ChromaTargets& targets,
                                HeadShared& shared, Logits& logits) {
  Ab mean;
  logits.for_row(half, [&](int q, float& logit) {
    if (q >= kAbBinCount) return;
    const float probability = softmax.probability(Softmax::exponential(logit, softmax.largest));
    mean.a += probability * targets.centres[q].a;
    mean.b += probability * targets.centres[q].b;
  });
  mean = {sum_of_row(mean.a, half, shared.sum[1]), sum_of_row(mean.b, half, shared.sum[2])};
  return {mean, mean_of(label, targets.centres), targets.regression_weight};
}

/// Turns logits into the gradient of the pixels' losses by them; returns this lane's part of the losses.
__device__ float loss_gradient(std::uint32_t first, std::uint32_t pixels, const ChromaTargets& targets,
                               HeadShared& shared, Logits& logits) {
  float loss = 0;
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const float largest = largest_of_row(logits, half, shared);
    float sum = 0;
    logits.for_row(half,
                   [&](int q, float& logit) { sum += q < kAbBinCount ? Softmax::exponential(logit, largest) : 0.0f; });
    const Softmax softmax(largest, sum_of_row(sum, half, shared.sum[0]));

    const std::uint32_t pixel = first + threadIdx.x % 32 / 4 + 8 * half;
    const float weight = pixel < pixels ? targets.pixel_weights[pixel] : 0.0f;
    const float scale = weight * targets.scale;
    const SoftLabel& label = targets.labels[min(pixel, pixels - 1)];
    const bool has_regression = targets.regression_weight > 0;
    const MeanError mean = has_regression ? mean_error(softmax, half, label, targets, shared, logits) : MeanError{};
    loss += threadIdx.x < 32 && threadIdx.x % 4 == 0 ? weight * targets.regression_weight * mean.cost : 0.0f;
    logits.for_row(half, [&](int q, float& logit) {
      const bool is_bin = q < kAbBinCount;
      const float log_probability = softmax.log_probability(logit);
      const float p = is_bin ? softmax.probability(Softmax::exponential(logit, largest)) : 0.0f;
      logit = logit_gradient(p, has_regression && is_bin ? mean.by_logit(p, targets.centres[q]) : 0.0f, scale);
#pragma unroll
      for (int i = 0; i < kSoftLabelBins; ++i) {
        if (label.bin[i] != q || label.weight[i] <= 0 || weight == 0) continue;
        logit += label_gradient(label.weight[i], scale);
        loss += weight * divergence(label.weight[i], log_probability);
      }
    });
  }
  return loss;
}

/// As decode_arg_max and decode_annealed_mean (ab_bins.h).
__device__ void write_colors(std::uint32_t first, std::uint32_t pixels, const ChromaDecoding& decoding,
                             HeadShared& shared, Logits& logits) {
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const float largest = largest_of_row(logits, half, shared);
    const std::uint32_t pixel = first + threadIdx.x % 32 / 4 + 8 * half;
    const bool writes = pixel < pixels && threadIdx.x < 32 && threadIdx.x % 4 == 0;
    if (decoding.temperature <= 0) {
      float most_probable = kAbBinCount;
      logits.for_row(half, [&](int q, float& logit) {
        if (q < kAbBinCount && logit == largest) most_probable = fminf(most_probable, float(q));
      });
      most_probable = of_row(most_probable, half, shared.sum[0], [](float a, float b) { return fminf(a, b); });
      if (writes) decoding.colors[pixel] = decoding.centres[min(int(most_probable), kAbBinCount - 1)];  // NaN: none is
      continue;
    }
    float sum = 0, a = 0, b = 0;
    logits.for_row(half, [&](int q, float& logit) {
      if (q >= kAbBinCount) return;
      const float weight = annealed_weight(logit, largest, decoding.temperature);
      const Ab centre = decoding.centres[q];
      sum += weight;
      a += weight * centre.a;
      b += weight * centre.b;
    });
    sum = sum_of_row(sum, half, shared.sum[0]);
    a = sum_of_row(a, half, shared.sum[1]);
    b = sum_of_row(b, half, shared.sum[2]);
    if (writes) decoding.colors[pixel] = {a / sum, b / sum};
  }
}

__device__ void write_logits(std::uint32_t first, std::uint32_t pixels, float* to, Logits& logits) {
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const std::uint32_t pixel = first + threadIdx.x % 32 / 4 + 8 * half;
    if (pixel >= pixels) continue;
    logits.for_row(half, [&](int q, float& logit) {
      if (q < kAbBinCount) to[std::size_t(pixel) * kAbBinCount + q] = logit;
    });
  }
}

/// Gradient of the composited features: of four warps, each 16 of them.
__device__ void feature_gradient(const HeadShared& shared, std::uint32_t first, std::uint32_t pixels,
                                 const ChromaTargets& targets) {
  const unsigned lane = threadIdx.x % 32, warp = threadIdx.x / 32, g = lane / 4, t = lane % 4;
  if (warp >= kFeatures / 16) return;
  float sums[2][4] = {};
#pragma unroll 4
  for (int k = 0; k < kOutputs / 16; ++k) {
    std::uint32_t a[4];
    load_operand(a, &shared.d_logits[lane % 16][16 * k + 8 * (lane / 16)]);
    const uint2* weights = shared.backward + (k * (kFeatures / 8) + 2 * warp) * 32 + lane;
    Bfloat::multiply_add(sums[0], a, weights[0]);
    Bfloat::multiply_add(sums[1], a, weights[32]);
  }
#pragma unroll
  for (int n = 0; n < 4; ++n) {
    const int b = n / 2, half = n % 2;
    const std::uint32_t row = g + 8 * half, pixel = first + row, column = 16 * warp + 8 * b + 2 * t;
    if (pixel >= pixels) continue;
    const float2 mean = shared.mean[row][column / 2];
    const float slope = spread_slope(targets.spread_weight, targets.scale);
    *reinterpret_cast<float2*>(&targets.d_composited[std::size_t(pixel) * kFeatures + column]) =
        make_float2(sums[b][2 * half] - slope * mean.x, sums[b][2 * half + 1] - slope * mean.y);
  }
}

/// @tparam Use  ChromaTargets, ChromaDecoding, or where logits are written to
template <typename Use>
__global__ void __launch_bounds__(kThreads, 1) head(const ChromaHeadJob job, const Use use) {
  constexpr bool kTrain = std::is_same_v<Use, ChromaTargets>;
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<HeadShared*>(memory);
  for (unsigned i = threadIdx.x; i < kHeadWeights / 4; i += kThreads) shared.forward[i] = job.weights.forward[i];
  if constexpr (kTrain) {
    for (unsigned i = threadIdx.x; i < kFeatures * kOutputs / 4; i += kThreads) {
      shared.backward[i] = job.weights.backward[i];
    }
  }
  if (threadIdx.x < kPixels * 16) {
    const unsigned p = threadIdx.x / 16, c = kFeatures + threadIdx.x % 16;
    shared.composited[p][c] = __half(c == kFeatures ? 1.0f : 0.0f);
    shared.inputs[p][c] = __nv_bfloat16(c == kFeatures ? 1.0f : 0.0f);
  }

  const int own = int(threadIdx.x) / 32 * kOfWarp;
  const std::uint32_t pixels = job.pixels.pixels;
  [[maybe_unused]] float d_weights[2][kInputs / 8][4] = {};
  [[maybe_unused]] double loss = 0;
  for (std::uint32_t first = blockIdx.x * kPixels; first < pixels; first += gridDim.x * kPixels) {
    [[maybe_unused]] const float spread = composite_features(job, first, shared);
    __syncthreads();
    Logits logits;
    apply_head(shared, logits);
    if constexpr (std::is_same_v<Use, float*>) write_logits(first, pixels, use, logits);
    if constexpr (std::is_same_v<Use, ChromaDecoding>) write_colors(first, pixels, use, shared, logits);
    if constexpr (kTrain) {
      loss += loss_gradient(first, pixels, use, shared, logits) + use.spread_weight * spread;
#pragma unroll
      for (int i = 0; i < 2; ++i) {
        std::uint32_t operand[4];
        pack_operand<Bfloat>(logits.of[i], operand);
        store_rows(shared.d_logits, 0, own + 16 * i, operand);
      }
      __syncthreads();
      feature_gradient(shared, first, pixels, use);
#pragma unroll
      for (int i = 0; i < 2; ++i) {
        add_weight_gradient<kPixels>(d_weights[i], shared.d_logits, own + 16 * i, shared.inputs, 0);
      }
    }
    __syncthreads();
  }
  if constexpr (kTrain) {
    float* part = use.d_weights + std::size_t(blockIdx.x) * kHeadWeights;
#pragma unroll
    for (int i = 0; i < 2; ++i) write_weight_gradient(d_weights[i], part, kInputs, own + 16 * i, 0);
    const float of_warp = warp_sum(float(loss));
    if (threadIdx.x % 32 == 0) atomicAdd(use.loss, double(of_warp));
  }
}

template <typename Use>
void launch_head(const ChromaHeadJob& job, const Use& use, cudaStream_t stream) {
  if (job.pixels.pixels == 0) return;
  resident_blocks<head<Use>>(kThreads, sizeof(HeadShared));
  head<Use><<<unsigned(chroma_head_parts(job.pixels.pixels)), kThreads, sizeof(HeadShared), stream>>>(job, use);
  CNERF_CUDA(cudaGetLastError());
}

}  // namespace

void prepare_samples(const PixelArrays& pixels, cudaStream_t stream) {
  if (pixels.pixels == 0) return;
  prepare<<<pixel_blocks(pixels.pixels), 32 * kPixelWarps, 0, stream>>>(pixels);
  CNERF_CUDA(cudaGetLastError());
}

void chroma_logits(const ChromaHeadJob& job, float* logits, cudaStream_t stream) {
  launch_head(job, logits, stream);
}
void chroma_colors(const ChromaHeadJob& job, const ChromaDecoding& decoding, cudaStream_t stream) {
  launch_head(job, decoding, stream);
}
void chroma_loss(const ChromaHeadJob& job, const ChromaTargets& targets, cudaStream_t stream) {
  launch_head(job, targets, stream);
}

int chroma_head_parts(std::uint32_t pixels) {
  return std::min(multiprocessors(), int((pixels + kPixels - 1) / kPixels));
}
int chroma_head_weight_count() {
  return kHeadWeights;
}
DenseLayer chroma_head_layer(TrainedWeights trained, PackedWeights packed) {
  return {kChromaHeadInputs, kChromaHeadOutputs, kInputs,         kOutputs, kFeatures,
          trained,           packed.forward,     packed.backward, nullptr};
}

void composite_chromaticity(const PixelArrays& pixels, const float2* logs, Ab* colors, cudaStream_t stream) {
  if (pixels.pixels == 0) return;
  composite<<<pixel_blocks(pixels.pixels), 32 * kPixelWarps, 0, stream>>>(pixels, logs, colors);
  CNERF_CUDA(cudaGetLastError());
}

void chromaticity_loss(const PixelArrays& pixels, const float2* logs, const ChromaticityTargets& targets,
                       cudaStream_t stream) {
  if (pixels.pixels == 0) return;
  compare<<<pixel_blocks(pixels.pixels), 32 * kPixelWarps, 0, stream>>>(pixels, logs, targets);
  CNERF_CUDA(cudaGetLastError());
}

void chromaticity_of_logs(const float2* logs, std::uint32_t count, Chromaticity* ratios, cudaStream_t stream) {
  if (count == 0) return;
  ratios_of<<<(count + 255) / 256, 256, 0, stream>>>(logs, count, ratios);
  CNERF_CUDA(cudaGetLastError());
}

}  // namespace cnerf
