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
constexpr int kTiles = 1;                    // of 16 rows, per warp
constexpr int kRows = 16 * kTiles * kWarps;  // of a block's tile
constexpr int kWide = kHiddenWidth + 8;      // padded: 8 rows fall into different banks
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

  const std::uint32_t n = min(*job.samples.count, job.samples.most);
  const int warp = int(threadIdx.x) / 32, lane = int(threadIdx.x) % 32, g = lane / 4, t = lane % 4;

  // This warp's share of each weight gradient: 16 outputs by N x 8 inputs.
  float d_luminance2[4][4] = {}, d_luminance1[2][4] = {}, d_density2[1][4] = {}, d_density1[KT][4] = {};
  float d_last[4][2][2] = {};
  const int out = 16 * (warp % 4), part = warp / 4;

  for (std::uint32_t tile = blockIdx.x * kRows; tile < n; tile += gridDim.x * kRows) {
    std::uint32_t sample[kTiles][2];  // of rows g and g + 8
    float2 d_raw[kTiles][2];
    std::uint32_t hidden_bits[kTiles], first_bits[kTiles];
    std::uint32_t d_second[kTiles][4][4];
    {
      // Load this warp's rows: gradients of the nets' outputs, encoded positions, directions.
      std::uint32_t in[kTiles][KT][4], features[kTiles][2][4];
#pragma unroll
      for (int m = 0; m < kTiles; ++m) {
#pragma unroll
        for (int half = 0; half < 2; ++half) {
          const std::uint32_t row = tile + std::uint32_t(16 * (warp * kTiles + m) + g + 8 * half);
          sample[m][half] = row;
          const std::uint32_t at = min(row, n - 1);
          d_raw[m][half] = row < n ? job.gradients[at] : make_float2(0, 0);
          load_encoded(in[m], half, job.encoded, at);
          const DirectionCode& direction = job.directions[__float_as_uint(job.places[at].w)];
          features[m][1][half] = direction.pair[t];
          features[m][1][half + 2] = direction.pair[t + 4];
        }
        store_halves<16 * KT + 8, KT>(shared.encoded, 16 * (warp * kTiles + m), in[m]);
      }
      // Forward through the density net and the luminance net's first layer.
      std::uint32_t hidden[kTiles][4][4];
      dense<Half, kTiles, KT, 4>(in, shared.forward + Shape::kPackedDensity1,
                                 [&](int m, int i, const float(&s)[2][4]) { pack_relu<Half>(s, hidden[m][i]); });
      dense<Half, kTiles, 4, 1>(hidden, shared.forward + Shape::kPackedDensity2,
                                [&](int m, int, const float(&s)[2][4]) { pack_operand<Half>(s, features[m][0]); });
      std::uint32_t first[kTiles][4][4];
      dense<Half, kTiles, 2, 4>(features, shared.forward + Shape::kPackedLuminance1,
                                [&](int m, int i, const float(&s)[2][4]) { pack_relu<Half>(s, first[m][i]); });
      // Share what the weight gradients need of all rows, and remember where ReLUs let through.
#pragma unroll
      for (int m = 0; m < kTiles; ++m) {
        const int row = 16 * (warp * kTiles + m);
        hidden_bits[m] = positive_bits(hidden[m]);
        first_bits[m] = positive_bits(first[m]);
        store_halves<kWide, 4>(shared.hidden, row, hidden[m]);
        store_halves<kFeatureStride, 2>(shared.features, row, features[m]);
        store_halves<kWide, 4>(shared.first, row, first[m]);
      }
      // Forward through the second layer and backward through the last one. That has one output, so its gradients are
      // products, not matrices.
      dense<Half, kTiles, 4, 4>(
          first, shared.forward + Shape::kPackedLuminance2, [&](int m, int i, const float(&s)[2][4]) {
#pragma unroll
            for (int block = 0; block < 2; ++block) {
              const float2 w = *reinterpret_cast<const float2*>(&shared.last_layer[16 * i + 8 * block + 2 * t]);
#pragma unroll
              for (int half = 0; half < 2; ++half) {
                const float d = d_raw[m][half].x, left = s[block][2 * half], right = s[block][2 * half + 1];
                d_last[i][block][0] += d * fmaxf(left, 0.0f);
                d_last[i][block][1] += d * fmaxf(right, 0.0f);
                d_second[m][i][2 * block + half] = Bfloat::pack(left > 0 ? d * w.x : 0.0f, right > 0 ? d * w.y : 0.0f);
              }
            }
          });
    }
#pragma unroll
    for (int m = 0; m < kTiles; ++m) {
#pragma unroll
      for (int k = 0; k < 4; ++k) store_rows(shared.gradient[0], 16 * (warp * kTiles + m), 16 * k, d_second[m][k]);
    }
    __syncthreads();

    // Backward through the luminance net's second layer.
    std::uint32_t d_first[kTiles][4][4];
    dense<Bfloat, kTiles, 4, 4>(d_second, shared.backward + Shape::kPackedLuminance2,
                                [&](int m, int i, const float(&s)[2][4]) {
                                  pack_operand<Bfloat>(s, d_first[m][i]);
#pragma unroll
                                  for (int r = 0; r < 4; ++r)
                                    d_first[m][i][r] = gate(d_first[m][i][r], first_bits[m], i, r);
                                  store_rows(shared.gradient[1], 16 * (warp * kTiles + m), 16 * i, d_first[m][i]);
                                });
    add_weight_gradient<kRows>(d_luminance2, shared.gradient[0], out, shared.first, 32 * part);
    __syncthreads();

    // Backward through the luminance net's first layer, but not to the direction. The gradient of log density joins
    // that of the geometry.
    std::uint32_t d_geometry[kTiles][1][4];
    dense<Bfloat, kTiles, 4, 1>(d_first, shared.backward + Shape::kPackedLuminance1,
                                [&](int m, int, const float(&s)[2][4]) {
                                  float sums[2][4];
#pragma unroll
                                  for (int i = 0; i < 8; ++i) sums[i / 4][i % 4] = s[i / 4][i % 4];
                                  if (t == 0) {
                                    sums[0][0] += d_raw[m][0].y;
                                    sums[0][2] += d_raw[m][1].y;
                                  }
                                  pack_operand<Bfloat>(sums, d_geometry[m][0]);
                                  store_rows(shared.gradient[0], 16 * (warp * kTiles + m), 0, d_geometry[m][0]);
                                });
    add_weight_gradient<kRows>(d_luminance1, shared.gradient[1], out, shared.features, 16 * part);
    __syncthreads();

    // Backward through the density net's second layer.
    std::uint32_t d_hidden[kTiles][4][4];
    dense<Bfloat, kTiles, 1, 4>(d_geometry, shared.backward + Shape::kPackedDensity2,
                                [&](int m, int i, const float(&s)[2][4]) {
                                  pack_operand<Bfloat>(s, d_hidden[m][i]);
#pragma unroll
                                  for (int r = 0; r < 4; ++r)
                                    d_hidden[m][i][r] = gate(d_hidden[m][i][r], hidden_bits[m], i, r);
                                  store_rows(shared.gradient[1], 16 * (warp * kTiles + m), 16 * i, d_hidden[m][i]);
                                });
    add_weight_gradient<kRows>(d_density2, shared.gradient[0], 0, shared.hidden, 8 * warp);
    __syncthreads();

    // Backward through the density net's first layer, to the hash grid's levels.
    dense<Bfloat, kTiles, 4, KT>(
        d_hidden, shared.backward + Shape::kPackedDensity1, [&](int m, int i, const float(&s)[2][4]) {
          write_level_gradients(s, i, sample[m], {job.d_encoded, job.levels, n, job.samples.most});
        });
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
    layer.forward = p.forward + first_packed;
    layer.backward = p.backward + first_packed;
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
