#include "src/field/cuda/point_kernels.h"

#include "src/base/cuda/device_memory.h"
#include "src/base/cuda/launch.h"
#include "src/field/cuda/channel_tiles.h"
#include "src/field/cuda/field_forward.cuh"
#include "src/field/cuda/net_backward.cuh"

namespace cnerf {
namespace {

constexpr int kWarps = 8;
constexpr int kThreads = 32 * kWarps;
constexpr int kRows = 16 * kWarps;  // samples of a block's tile in the backward pass

/// @tparam KT  encoded channels / 16, rounded up
template <int KT, PointOutputs kOutputs>
struct PointShape {
  static constexpr int kEncoded = 16 * KT;
  static constexpr int kOutputTiles = kOutputs == PointOutputs::kFeatures ? kPointFeatures / 16 : 1;
  static constexpr int kFirst = 0;
  static constexpr int kSecond = kHiddenWidth * kEncoded;
  static constexpr int kWeights = kSecond + 16 * kOutputTiles * kHiddenWidth;
  // In uint2, four weights each:
  static constexpr int kPacked = kWeights / 4;
  static constexpr int kPackedFirst = kFirst / 4;
  static constexpr int kPackedSecond = kSecond / 4;
};

/// Calls `work(PointShape)`.
template <typename Work>
void with_shape(PointOutputs outputs, int levels, Work&& work) {
  with_channel_tiles(levels, [&](auto tiles) {
    constexpr int KT = decltype(tiles)::value;
    if (outputs == PointOutputs::kFeatures) {
      work(PointShape<KT, PointOutputs::kFeatures>{});
    } else {
      work(PointShape<KT, PointOutputs::kNumbers>{});
    }
  });
}

template <int KT, PointOutputs kOutputs>
struct ForwardShared {
  uint2 weights[PointShape<KT, kOutputs>::kPacked];
  WarpEncoding<KT> warp[kWarps];
};

template <int KT, PointOutputs kOutputs>
__global__ void __launch_bounds__(kThreads, 2)
    forward(const __grid_constant__ GridLevels levels, const PointForwardJob job) {
  using Shape = PointShape<KT, kOutputs>;
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<ForwardShared<KT, kOutputs>*>(memory);
  for (unsigned i = threadIdx.x; i < Shape::kPacked; i += kThreads) shared.weights[i] = job.weights[i];
  const unsigned lane = threadIdx.x % 32, g = lane / 4, t = lane % 4;
  WarpEncoding<KT>& warp = shared.warp[threadIdx.x / 32];
  warp.clear(lane);
  __syncthreads();

  for (std::uint32_t first = (blockIdx.x * kWarps + threadIdx.x / 32) * 32; first < job.count;
       first += gridDim.x * kThreads) {
    warp.encode(levels, job.table, in_box(job.positions[min(first + lane, job.count - 1)]), lane);
    __syncwarp();
    if (job.encoded != nullptr) {
      warp.store(job.encoded + std::size_t(first) * (2 * KT), 32, job.count - first, lane);
    }
    std::uint32_t hidden[kWarpTiles][4][4];
    warp.hidden_layer(shared.weights + Shape::kPackedFirst, hidden);
    dense<Half, kWarpTiles, 4, Shape::kOutputTiles>(
        hidden, shared.weights + Shape::kPackedSecond, [&](int m, int i, const float(&sums)[2][4]) {
          if constexpr (kOutputs == PointOutputs::kFeatures) {
            std::uint32_t operand[4];
            pack_relu<Half>(sums, operand);
#pragma unroll
            for (int r = 0; r < 4; ++r) {
              const std::uint32_t row = first + 16 * m + g + 8 * (r % 2);
              if (row < job.count) job.features[std::size_t(row) * 32 + 8 * i + 4 * (r / 2) + t] = operand[r];
            }
          } else if (t == 0) {
#pragma unroll
            for (int half = 0; half < 2; ++half) {
              const std::uint32_t row = first + 16 * m + g + 8 * half;
              if (row < job.count) job.numbers[row] = make_float2(sums[0][2 * half], sums[0][2 * half + 1]);
            }
          }
        });
    __syncwarp();
  }
}

template <int KT, PointOutputs kOutputs>
struct BackwardShared {
  using Shape = PointShape<KT, kOutputs>;
  uint2 forward[Shape::kPacked];
  uint2 backward[Shape::kPacked];
  // Rows are padded: 8 of them fall into different banks.
  alignas(16) __nv_bfloat16 encoded[kRows][16 * KT + 8];
  alignas(16) __nv_bfloat16 hidden[kRows][kHiddenWidth + 8];
  alignas(16) __nv_bfloat16 d_hidden[kRows][kHiddenWidth + 8];
  alignas(16) __nv_bfloat16 d_outputs[kRows][16 * Shape::kOutputTiles + 8];
};

/// Gradient of the outputs of rows g and g + 8, as left operands.
template <int KT>
__device__ void output_gradient(const PointBackwardJob& job, const std::uint32_t (&sample)[2], std::uint32_t n,
                                const std::uint32_t (&hidden)[1][4][4], const uint2* weights,
                                std::uint32_t (&d_outputs)[1][4][4]) {
  const int t = int(threadIdx.x) % 4;
  float share[2];
  const float* d_pixel[2];
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const std::uint32_t at = min(sample[half], n - 1);
    share[half] = sample[half] < n ? job.gradient.shares[at] : 0.0f;
    d_pixel[half] = job.gradient.d_composited + std::size_t(__float_as_uint(job.places[at].w)) * kPointFeatures;
  }
  dense<Half, 1, 4, 4>(hidden, weights, [&](int, int i, const float(&sums)[2][4]) {
#pragma unroll
    for (int block = 0; block < 2; ++block) {
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        const float2 d = *reinterpret_cast<const float2*>(d_pixel[half] + 16 * i + 8 * block + 2 * t);
        // Features as they were composited: rounded.
        const float2 h = floats_of_halves(Half::pack(sums[block][2 * half], sums[block][2 * half + 1]));
        d_outputs[0][i][2 * block + half] =
            Bfloat::pack(h.x > 0 ? share[half] * (d.x + job.gradient.d_feature * h.x) : 0.0f,
                         h.y > 0 ? share[half] * (d.y + job.gradient.d_feature * h.y) : 0.0f);
      }
    }
  });
}
template <int KT>
__device__ void output_gradient(const PointBackwardJob& job, const std::uint32_t (&sample)[2], std::uint32_t n,
                                const std::uint32_t (&)[1][4][4], const uint2*, std::uint32_t (&d_outputs)[1][1][4]) {
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const bool has_numbers = threadIdx.x % 4 == 0 && sample[half] < n;
    const float2 d = has_numbers ? job.gradient.d_numbers[sample[half]] : make_float2(0, 0);
    d_outputs[0][0][half] = Bfloat::pack(d.x, d.y);
    d_outputs[0][0][half + 2] = 0;
  }
}

/// As stage 1's backward kernel (field_backward.cu), with one net.
template <int KT, PointOutputs kOutputs>
__global__ void __launch_bounds__(kThreads, 1) backward(const PointBackwardJob job) {
  using Shape = PointShape<KT, kOutputs>;
  constexpr int kOutputTiles = Shape::kOutputTiles;
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<BackwardShared<KT, kOutputs>*>(memory);
  for (unsigned i = threadIdx.x; i < Shape::kPacked; i += kThreads) {
    shared.forward[i] = job.weights.forward[i];
    shared.backward[i] = job.weights.backward[i];
  }
  __syncthreads();

  const std::uint32_t n = min(*job.samples.count, job.samples.most);
  const LevelGradients level_gradients{job.levels, n, job.samples.most, job.d_encoded};
  const int warp = int(threadIdx.x) / 32, g = int(threadIdx.x) % 32 / 4;
  // This warp's share of each weight gradient: 16 outputs by N x 8 inputs.
  float d_second[kOutputTiles][4] = {}, d_first[KT][4] = {};
  const int out = 16 * (warp % 4), part = warp / 4;
  const int second_out = kOutputTiles == 1 ? 0 : out, second_in = kOutputTiles == 1 ? 8 * warp : 32 * part;

  for (std::uint32_t tile = blockIdx.x * kRows; tile < n; tile += gridDim.x * kRows) {
    const std::uint32_t sample[2] = {tile + 16 * warp + g, tile + 16 * warp + g + 8};
    std::uint32_t in[1][KT][4], hidden[1][4][4], d_outputs[1][kOutputTiles][4];
    load_encoded(in[0], 0, job.encoded, min(sample[0], n - 1));
    load_encoded(in[0], 1, job.encoded, min(sample[1], n - 1));
    dense<Half, 1, KT, 4>(in, shared.forward + Shape::kPackedFirst,
                          [&](int, int i, const float(&s)[2][4]) { pack_relu<Half>(s, hidden[0][i]); });
    output_gradient<KT>(job, sample, n, hidden, shared.forward + Shape::kPackedSecond, d_outputs);
    const std::uint32_t hidden_bits = positive_bits(hidden[0]);
    store_halves<16 * KT + 8, KT>(shared.encoded, 16 * warp, in[0]);
    store_halves<kHiddenWidth + 8, 4>(shared.hidden, 16 * warp, hidden[0]);
#pragma unroll
    for (int i = 0; i < kOutputTiles; ++i) store_rows(shared.d_outputs, 16 * warp, 16 * i, d_outputs[0][i]);

    std::uint32_t d_hidden[1][4][4];
    dense<Bfloat, 1, kOutputTiles, 4>(d_outputs, shared.backward + Shape::kPackedSecond,
                                      [&](int, int i, const float(&s)[2][4]) {
                                        through_relu(s, hidden_bits, i, d_hidden[0][i], shared.d_hidden, 16 * warp);
                                      });
    dense<Bfloat, 1, 4, KT>(d_hidden, shared.backward + Shape::kPackedFirst,
                            [&](int, int i, const float(&s)[2][4]) { level_gradients.write(s, i, sample); });
    __syncthreads();
    add_weight_gradient<kRows>(d_second, shared.d_outputs, second_out, shared.hidden, second_in);
    add_weight_gradient<kRows>(d_first, shared.d_hidden, out, shared.encoded, 8 * KT * part);
    __syncthreads();
  }
  float* d_weights = job.d_weights + std::size_t(blockIdx.x) * Shape::kWeights;
  write_weight_gradient(d_second, d_weights + Shape::kSecond, kHiddenWidth, second_out, second_in);
  write_weight_gradient(d_first, d_weights + Shape::kFirst, Shape::kEncoded, out, 8 * KT * part);
}

}  // namespace

void point_forward(PointOutputs outputs, const PointForwardJob& job, cudaStream_t stream) {
  if (job.count == 0) return;
  with_shape(outputs, int(job.levels->size()), [&]<int KT, PointOutputs kOutputs>(PointShape<KT, kOutputs>) {
    using Shared = ForwardShared<KT, kOutputs>;
    const unsigned most = resident_blocks<forward<KT, kOutputs>>(kThreads, sizeof(Shared));
    const unsigned blocks = std::min(most, (job.count + kThreads - 1) / kThreads);
    forward<KT, kOutputs>
        <<<blocks, kThreads, sizeof(Shared), stream>>>(GridLevels(job.levels->data(), job.levels->size()), job);
    CNERF_CUDA(cudaGetLastError());
  });
}

int point_backward_blocks() {
  return multiprocessors();
}

int point_weight_count(PointOutputs outputs, int levels) {
  int count = 0;
  with_shape(outputs, levels, [&](auto shape) { count = decltype(shape)::kWeights; });
  return count;
}

void point_backward(PointOutputs outputs, const PointBackwardJob& job, cudaStream_t stream) {
  with_shape(outputs, job.levels, [&]<int KT, PointOutputs kOutputs>(PointShape<KT, kOutputs>) {
    using Shared = BackwardShared<KT, kOutputs>;
    resident_blocks<backward<KT, kOutputs>>(kThreads, sizeof(Shared));
    backward<KT, kOutputs><<<unsigned(point_backward_blocks()), kThreads, sizeof(Shared), stream>>>(job);
    CNERF_CUDA(cudaGetLastError());
  });
}

std::vector<DenseLayer> point_layers(PointOutputs outputs, int levels, TrainedWeights trained, PackedWeights packed) {
  std::vector<DenseLayer> layers;
  const int channels = 4 * levels;
  const int numbers = outputs == PointOutputs::kFeatures ? kPointFeatures : kPointNumbers;
  with_shape(outputs, levels, [&](auto shape) {
    using Shape = decltype(shape);
    layers = {{channels, kHiddenWidth, Shape::kEncoded, kHiddenWidth, Shape::kEncoded, trained,
               packed.forward + Shape::kPackedFirst, packed.backward + Shape::kPackedFirst, nullptr},
              {kHiddenWidth, numbers, kHiddenWidth, 16 * Shape::kOutputTiles, kHiddenWidth,
               trained.from(kHiddenWidth * channels), packed.forward + Shape::kPackedSecond,
               packed.backward + Shape::kPackedSecond, nullptr}};
  });
  return layers;
}

}  // namespace cnerf
