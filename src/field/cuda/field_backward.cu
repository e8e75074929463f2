#include "src/field/cuda/field_backward.h"

#include "src/base/cuda/device_memory.h"
#include "src/base/cuda/launch.h"
#include "src/field/cuda/channel_tiles.h"
#include "src/field/cuda/field_forward.cuh"
#include "src/field/cuda/net_backward.cuh"

namespace cnerf {
namespace {

// A block works on tiles of samples. Each warp takes its rows through both nets, forward and backward, in registers;
// what the weight gradients need of all rows (inputs and gradients of every layer) lies in shared memory, in bfloat16.
// A weight gradient is shared out over the warps and stays in their registers until all tiles are done.
constexpr int kWarps = 8;
constexpr int kThreads = 32 * kWarps;
constexpr int kRows = 16 * kWarps;       // of a block's tile; 16 per warp
constexpr int kWide = kHiddenWidth + 8;  // padded: 8 rows fall into different banks
constexpr int kFeatureStride = 32 + 8;

template <int KT>
struct BackwardShared {
  uint2 forward[FieldShape<KT>::kPacked];
  uint2 backward[FieldShape<KT>::kPacked];
  float last_layer[kHiddenWidth];
  float d_last_layer[kWarps][kHiddenWidth];
  alignas(16) __nv_bfloat16 encoded[kRows][16 * KT + 8];
  alignas(16) __nv_bfloat16 hidden[kRows][kWide];
  alignas(16) __nv_bfloat16 features[kRows][kFeatureStride];
  alignas(16) __nv_bfloat16 first[kRows][kWide];
  alignas(16) __nv_bfloat16 gradient[2][kRows][kWide];  ///< of two layers in turn
};

template <int KT>
__global__ void __launch_bounds__(kThreads, 1) backward(const FieldBackwardJob job) {
  using Shape = FieldShape<KT>;
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<BackwardShared<KT>*>(memory);
  // Load the weights of both nets.
  for (unsigned i = threadIdx.x; i < Shape::kPacked; i += kThreads) {
    shared.forward[i] = job.nets.weights.forward[i];
    shared.backward[i] = job.nets.weights.backward[i];
  }
  if (threadIdx.x < kHiddenWidth) shared.last_layer[threadIdx.x] = job.nets.last_layer[threadIdx.x];
  __syncthreads();

  const std::uint32_t n = min(*job.samples.count.count, job.samples.count.most);
  const int warp = int(threadIdx.x) / 32, lane = int(threadIdx.x) % 32, g = lane / 4, t = lane % 4;
  const int own = 16 * warp;  // first row

  // This warp's share of each weight gradient: 16 outputs by N x 8 inputs.
  float d_luminance2[4][4] = {}, d_luminance1[2][4] = {}, d_density2[1][4] = {}, d_density1[KT][4] = {};
  float d_last[4][2][2] = {};
  const int out = 16 * (warp % 4), part = warp / 4;

  const LevelGradients level_gradients{job.levels, n, job.samples.count.most, job.d_encoded};
  for (std::uint32_t tile = blockIdx.x * kRows; tile < n; tile += gridDim.x * kRows) {
    std::uint32_t sample[2];  // of rows g and g + 8
    float2 d_raw[2];
    std::uint32_t hidden_bits, first_bits;
    std::uint32_t d_second[1][4][4];
    {
      // Load this warp's rows: gradients of the nets' outputs, encoded positions, directions.
      std::uint32_t in[1][KT][4], features[1][2][4];
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        sample[half] = tile + std::uint32_t(own + g + 8 * half);
        const std::uint32_t at = min(sample[half], n - 1);
        d_raw[half] = sample[half] < n ? job.samples.gradients[at] : make_float2(0, 0);
        load_encoded(in[0], half, job.samples.encoded, at);
        const DirectionCode& direction = job.samples.directions[__float_as_uint(job.samples.places[at].w)];
        features[0][1][half] = direction.pair[t];
        features[0][1][half + 2] = direction.pair[t + 4];
      }
      store_halves<16 * KT + 8, KT>(shared.encoded, own, in[0]);
      // Forward through the density net and the luminance net's first layer.
      std::uint32_t hidden[1][4][4];
      dense<Half, 1, KT, 4>(in, shared.forward + Shape::kPackedDensity1,
                            [&](int, int i, const float(&s)[2][4]) { pack_relu<Half>(s, hidden[0][i]); });
      dense<Half, 1, 4, 1>(hidden, shared.forward + Shape::kPackedDensity2,
                           [&](int, int, const float(&s)[2][4]) { pack_operand<Half>(s, features[0][0]); });
      std::uint32_t first[1][4][4];
      dense<Half, 1, 2, 4>(features, shared.forward + Shape::kPackedLuminance1,
                           [&](int, int i, const float(&s)[2][4]) { pack_relu<Half>(s, first[0][i]); });
      // Share what the weight gradients need of all rows, and remember where ReLUs let through.
      hidden_bits = positive_bits(hidden[0]);
      first_bits = positive_bits(first[0]);
      store_halves<kWide, 4>(shared.hidden, own, hidden[0]);
      store_halves<kFeatureStride, 2>(shared.features, own, features[0]);
      store_halves<kWide, 4>(shared.first, own, first[0]);
      // Forward through the second layer and backward through the last one. That has one output, so its gradients are
      // products, not matrices.
      dense<Half, 1, 4, 4>(first, shared.forward + Shape::kPackedLuminance2, [&](int, int i, const float(&s)[2][4]) {
#pragma unroll
        for (int block = 0; block < 2; ++block) {
          const float2 w = *reinterpret_cast<const float2*>(&shared.last_layer[16 * i + 8 * block + 2 * t]);
#pragma unroll
          for (int half = 0; half < 2; ++half) {
            const float d = d_raw[half].x, left = s[block][2 * half], right = s[block][2 * half + 1];
            d_last[i][block][0] += d * fmaxf(left, 0.0f);
            d_last[i][block][1] += d * fmaxf(right, 0.0f);
            d_second[0][i][2 * block + half] = Bfloat::pack(left > 0 ? d * w.x : 0.0f, right > 0 ? d * w.y : 0.0f);
          }
        }
      });
    }
#pragma unroll
    for (int k = 0; k < 4; ++k) store_rows(shared.gradient[0], own, 16 * k, d_second[0][k]);
    __syncthreads();

    // Backward through the luminance net's second layer.
    std::uint32_t d_first[1][4][4];
    dense<Bfloat, 1, 4, 4>(d_second, shared.backward + Shape::kPackedLuminance2,
                           [&](int, int i, const float(&s)[2][4]) {
                             through_relu(s, first_bits, i, d_first[0][i], shared.gradient[1], own);
                           });
    add_weight_gradient<kRows>(d_luminance2, shared.gradient[0], out, shared.first, 32 * part);
    __syncthreads();

    // Backward through the luminance net's first layer, but not to the direction. The gradient of log density joins
    // that of the geometry.
    std::uint32_t d_geometry[1][1][4];
    dense<Bfloat, 1, 4, 1>(d_first, shared.backward + Shape::kPackedLuminance1, [&](int, int, const float(&s)[2][4]) {
      float sums[2][4];
#pragma unroll
      for (int i = 0; i < 8; ++i) sums[i / 4][i % 4] = s[i / 4][i % 4];
      if (t == 0) {
        sums[0][0] += d_raw[0].y;
        sums[0][2] += d_raw[1].y;
      }
      pack_operand<Bfloat>(sums, d_geometry[0][0]);
      store_rows(shared.gradient[0], own, 0, d_geometry[0][0]);
    });
    add_weight_gradient<kRows>(d_luminance1, shared.gradient[1], out, shared.features, 16 * part);
    __syncthreads();

    // Backward through the density net's second layer.
    std::uint32_t d_hidden[1][4][4];
    dense<Bfloat, 1, 1, 4>(d_geometry, shared.backward + Shape::kPackedDensity2,
                           [&](int, int i, const float(&s)[2][4]) {
                             through_relu(s, hidden_bits, i, d_hidden[0][i], shared.gradient[1], own);
                           });
    add_weight_gradient<kRows>(d_density2, shared.gradient[0], 0, shared.hidden, 8 * warp);
    __syncthreads();

    // Backward through the density net's first layer, to the hash grid's levels.
    dense<Bfloat, 1, 4, KT>(d_hidden, shared.backward + Shape::kPackedDensity1,
                            [&](int, int i, const float(&s)[2][4]) { level_gradients.write(s, i, sample); });
    add_weight_gradient<kRows>(d_density1, shared.gradient[1], out, shared.encoded, 8 * KT * part);
    __syncthreads();
  }

  float* d_weights = job.d_weights + std::size_t(blockIdx.x) * Shape::kWeights;
  write_weight_gradient(d_luminance2, d_weights + Shape::kLuminance2, kHiddenWidth, out, 32 * part);
  write_weight_gradient(d_luminance1, d_weights + Shape::kLuminance1, Shape::kFeatures, out, 16 * part);
  write_weight_gradient(d_density2, d_weights + Shape::kDensity2, kHiddenWidth, 0, 8 * warp);
  write_weight_gradient(d_density1, d_weights + Shape::kDensity1, Shape::kEncoded, out, 8 * KT * part);
#pragma unroll
  for (int i = 0; i < 16; ++i) {
    float sum = d_last[i / 4][i / 2 % 2][i % 2];
    for (int offset = 4; offset < 32; offset *= 2) sum += __shfl_xor_sync(~0u, sum, offset);
    if (g == 0) shared.d_last_layer[warp][16 * (i / 4) + 8 * (i / 2 % 2) + 2 * t + i % 2] = sum;
  }
  __syncthreads();
  if (threadIdx.x >= kHiddenWidth) return;
  float sum = 0;
  for (int w = 0; w < kWarps; ++w) sum += shared.d_last_layer[w][threadIdx.x];
  d_weights[Shape::kLuminance3 + threadIdx.x] = sum;
}

}  // namespace

int field_backward_blocks() {
  return multiprocessors();
}

int field_weight_count(int levels) {
  int count = 0;
  with_channel_tiles(levels, [&](auto tiles) { count = FieldShape<decltype(tiles)::value>::kWeights; });
  return count;
}

void field_backward(const FieldBackwardJob& job, cudaStream_t stream) {
  with_channel_tiles(job.levels, [&](auto tiles) {
    constexpr int KT = decltype(tiles)::value;
    constexpr int kShared = sizeof(BackwardShared<KT>);
    resident_blocks<backward<KT>>(kThreads, kShared);
    backward<KT><<<unsigned(field_backward_blocks()), kThreads, kShared, stream>>>(job);
    CNERF_CUDA(cudaGetLastError());
  });
}

std::vector<DenseLayer> field_layers(int levels, const FieldParameters& p) {
  const int channels = 4 * levels;
  std::vector<DenseLayer> layers;
  /// A packed layer whose inputs and outputs all count and are asked for in the backward pass.
  const auto add = [&](TrainedWeights trained, int inputs, int outputs, int first_packed) -> DenseLayer& {
    DenseLayer& layer = layers.emplace_back();
    layer.inputs = layer.padded_inputs = layer.backward_inputs = inputs;
    layer.outputs = layer.padded_outputs = outputs;
    layer.trained = trained;
    layer.forward = p.packed.forward + first_packed;
    layer.backward = p.packed.backward + first_packed;
    return layer;
  };
  with_channel_tiles(levels, [&](auto tiles) {
    using Shape = FieldShape<decltype(tiles)::value>;
    DenseLayer& encoding = add(p.density, channels, kHiddenWidth, Shape::kPackedDensity1);
    encoding.padded_inputs = encoding.backward_inputs = Shape::kEncoded;
    add(p.density.from(kHiddenWidth * channels), kHiddenWidth, kGeometryChannels, Shape::kPackedDensity2);
    DenseLayer& features = add(p.luminance, Shape::kFeatures, kHiddenWidth, Shape::kPackedLuminance1);
    features.backward_inputs = kGeometryChannels;  // the direction's gradient is not needed
    add(p.luminance.from(kHiddenWidth * Shape::kFeatures), kHiddenWidth, kHiddenWidth, Shape::kPackedLuminance2);

    DenseLayer& last = layers.emplace_back();
    last.inputs = last.padded_inputs = kHiddenWidth;
    last.outputs = last.padded_outputs = 1;
    last.trained = p.luminance.from(kHiddenWidth * (Shape::kFeatures + kHiddenWidth));
    last.plain = p.last_layer;
  });
  return layers;
}

}  // namespace cnerf
