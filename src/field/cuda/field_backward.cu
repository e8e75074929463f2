#include "src/field/cuda/field_backward.h"

#include "src/base/cuda/device_memory.h"
#include "src/field/adam.h"
#include "src/field/cuda/channel_tiles.h"
#include "src/field/cuda/field_forward.cuh"

namespace cnerf {
namespace {

// A block works on tiles of samples. Each warp takes its rows through both nets, forward and backward, in registers;
// what the weight gradients need of all rows (inputs and gradients of every layer) lies in shared memory, in bfloat16.
// A weight gradient is shared out over the warps and stays in their registers until all tiles are done.
constexpr int kWarps = 8;
constexpr int kThreads = 32 * kWarps;
constexpr int kTiles = 1;                         // of 16 rows a warp
constexpr int kRows = 16 * kTiles * kWarps;       // of a block's tile
constexpr int kWide = kHiddenWidth + 8;           // padded: 8 rows fall into different banks
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

/// Which numbers of a left operand of 64 columns are positive: bit 4 k + register of either half word.
__device__ std::uint32_t positive_bits(const std::uint32_t (&halves)[4][4]) {
  std::uint32_t bits = 0;
#pragma unroll
  for (int k = 0; k < 4; ++k) {
#pragma unroll
    for (int r = 0; r < 4; ++r) {
      const std::uint32_t mask = __hgt2_mask(*reinterpret_cast<const __half2*>(&halves[k][r]), __half2half2(__half(0.0f)));
      bits |= mask & (0x00010001u << (4 * k + r));
    }
  }
  return bits;
}
__device__ std::uint32_t gate(std::uint32_t pair, std::uint32_t bits, int k, int r) {
  return pair & (((bits >> (4 * k + r)) & 0x00010001u) * 0xffffu);
}

/// Stores a left operand's part of 16 columns as rows, from `row` = the warp's first one.
template <int stride>
__device__ void store_rows(__nv_bfloat16 (*rows)[stride], int row, int column, const std::uint32_t (&bfloats)[4]) {
  const int g = int(threadIdx.x) % 32 / 4, t = int(threadIdx.x) % 4;
#pragma unroll
  for (int r = 0; r < 4; ++r) {
    *reinterpret_cast<std::uint32_t*>(&rows[row + g + 8 * (r % 2)][column + 2 * t + 8 * (r / 2)]) = bfloats[r];
  }
}
template <int stride, int K>
__device__ void store_halves(__nv_bfloat16 (*rows)[stride], int row, const std::uint32_t (&halves)[K][4]) {
#pragma unroll
  for (int k = 0; k < K; ++k) {
    std::uint32_t bfloats[4];
#pragma unroll
    for (int r = 0; r < 4; ++r) bfloats[r] = bfloats_of_halves(halves[k][r]);
    store_rows(rows, row, 16 * k, bfloats);
  }
}

/// sums[i] += rows of d_out (16 outputs from `out`) transposed times rows of in (8 inputs from `in + 8 i`).
template <int N, int out_stride, int in_stride>
__device__ void add_weight_gradient(float (&sums)[N][4], const __nv_bfloat16 (*d_out)[out_stride], int out,
                                    const __nv_bfloat16 (*inputs)[in_stride], int in) {
  const int lane = int(threadIdx.x) % 32;
#pragma unroll 2
  for (int k = 0; k < kRows; k += 16) {
    std::uint32_t a[4];
    load_transposed(a, &d_out[k + lane % 8 + lane / 16 * 8][out + lane / 8 % 2 * 8]);
    if constexpr (N % 2 == 0) {
#pragma unroll
      for (int i = 0; i < N; i += 2) {
        std::uint32_t b[4];
        load_transposed(b, &inputs[k + lane % 16][in + 8 * i + lane / 16 * 8]);
        Bfloat::multiply_add(sums[i], a, make_uint2(b[0], b[1]));
        Bfloat::multiply_add(sums[i + 1], a, make_uint2(b[2], b[3]));
      }
    } else {
#pragma unroll
      for (int i = 0; i < N; ++i) {
        Bfloat::multiply_add(sums[i], a, load_transposed_pair(&inputs[k + lane % 16][in + 8 * i]));
      }
    }
  }
}
template <int N>
__device__ void write_weight_gradient(const float (&sums)[N][4], float* d_weights, int inputs, int out, int in) {
  const int g = int(threadIdx.x) % 32 / 4, t = int(threadIdx.x) % 4;
#pragma unroll
  for (int i = 0; i < N; ++i) {
    float* at = d_weights + (out + g) * inputs + in + 8 * i + 2 * t;
    *reinterpret_cast<float2*>(at) = make_float2(sums[i][0], sums[i][1]);
    *reinterpret_cast<float2*>(at + 8 * inputs) = make_float2(sums[i][2], sums[i][3]);
  }
}

template <int KT>
__global__ void __launch_bounds__(kThreads, 1) backward(const FieldBackwardJob job) {
  using Shape = FieldShape<KT>;
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<BackwardShared<KT>*>(memory);
  for (unsigned i = threadIdx.x; i < Shape::kPacked; i += kThreads) {
    shared.forward[i] = job.nets.forward[i];
    shared.backward[i] = job.nets.backward[i];
  }
  if (threadIdx.x < kHiddenWidth) shared.last_layer[threadIdx.x] = job.nets.last_layer[threadIdx.x];
  __syncthreads();

  const std::uint32_t n = min(*job.samples.count, job.samples.most);
  const int warp = int(threadIdx.x) / 32, lane = int(threadIdx.x) % 32, g = lane / 4, t = lane % 4;
  const auto* encoded = reinterpret_cast<const std::uint32_t*>(job.encoded);
  auto* d_encoded = static_cast<std::uint32_t*>(job.d_encoded);

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
      std::uint32_t in[kTiles][KT][4], features[kTiles][2][4];
#pragma unroll
      for (int m = 0; m < kTiles; ++m) {
#pragma unroll
        for (int half = 0; half < 2; ++half) {
          const std::uint32_t row = tile + std::uint32_t(16 * (warp * kTiles + m) + g + 8 * half);
          sample[m][half] = row;
          const std::uint32_t at = min(row, n - 1);
          d_raw[m][half] = row < n ? job.gradients[at] : make_float2(0, 0);
#pragma unroll
          for (int k = 0; k < KT; ++k) {
            in[m][k][half] = encoded[std::size_t(at) * (8 * KT) + 8 * k + t];
            in[m][k][half + 2] = encoded[std::size_t(at) * (8 * KT) + 8 * k + t + 4];
          }
          const DirectionCode& direction = job.directions[__float_as_uint(job.places[at].w)];
          features[m][1][half] = direction.pair[t];
          features[m][1][half + 2] = direction.pair[t + 4];
        }
        store_halves<16 * KT + 8, KT>(shared.encoded, 16 * (warp * kTiles + m), in[m]);
      }
      std::uint32_t hidden[kTiles][4][4];
      dense<Half, kTiles, KT, 4>(in, shared.forward + Shape::kPackedDensity1,
                                 [&](int m, int i, const float (&s)[2][4]) { pack_relu<Half>(s, hidden[m][i]); });
      dense<Half, kTiles, 4, 1>(hidden, shared.forward + Shape::kPackedDensity2,
                                [&](int m, int, const float (&s)[2][4]) { pack_operand<Half>(s, features[m][0]); });
      std::uint32_t first[kTiles][4][4];
      dense<Half, kTiles, 2, 4>(features, shared.forward + Shape::kPackedLuminance1,
                                [&](int m, int i, const float (&s)[2][4]) { pack_relu<Half>(s, first[m][i]); });
#pragma unroll
      for (int m = 0; m < kTiles; ++m) {
        const int row = 16 * (warp * kTiles + m);
        hidden_bits[m] = positive_bits(hidden[m]);
        first_bits[m] = positive_bits(first[m]);
        store_halves<kWide, 4>(shared.hidden, row, hidden[m]);
        store_halves<kFeatureStride, 2>(shared.features, row, features[m]);
        store_halves<kWide, 4>(shared.first, row, first[m]);
      }
      // The last layer has one output, so its gradients are products, not matrices.
      dense<Half, kTiles, 4, 4>(first, shared.forward + Shape::kPackedLuminance2,
                                [&](int m, int i, const float (&s)[2][4]) {
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

    // Luminance net, second layer.
    std::uint32_t d_first[kTiles][4][4];
    dense<Bfloat, kTiles, 4, 4>(d_second, shared.backward + Shape::kPackedLuminance2,
                                [&](int m, int i, const float (&s)[2][4]) {
      pack_operand<Bfloat>(s, d_first[m][i]);
#pragma unroll
      for (int r = 0; r < 4; ++r) d_first[m][i][r] = gate(d_first[m][i][r], first_bits[m], i, r);
      store_rows(shared.gradient[1], 16 * (warp * kTiles + m), 16 * i, d_first[m][i]);
    });
    add_weight_gradient(d_luminance2, shared.gradient[0], out, shared.first, 32 * part);
    __syncthreads();

    // Luminance net, first layer; nothing is wanted of the direction. Log density joins the geometry's gradient.
    std::uint32_t d_geometry[kTiles][1][4];
    dense<Bfloat, kTiles, 4, 1>(d_first, shared.backward + Shape::kPackedLuminance1,
                                [&](int m, int, const float (&s)[2][4]) {
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
    add_weight_gradient(d_luminance1, shared.gradient[1], out, shared.features, 16 * part);
    __syncthreads();

    // Density net, second layer.
    std::uint32_t d_hidden[kTiles][4][4];
    dense<Bfloat, kTiles, 1, 4>(d_geometry, shared.backward + Shape::kPackedDensity2,
                                [&](int m, int i, const float (&s)[2][4]) {
      pack_operand<Bfloat>(s, d_hidden[m][i]);
#pragma unroll
      for (int r = 0; r < 4; ++r) d_hidden[m][i][r] = gate(d_hidden[m][i][r], hidden_bits[m], i, r);
      store_rows(shared.gradient[1], 16 * (warp * kTiles + m), 16 * i, d_hidden[m][i]);
    });
    add_weight_gradient(d_density2, shared.gradient[0], 0, shared.hidden, 8 * warp);
    __syncthreads();

    // Density net, first layer, and what the hash grid's levels receive.
    dense<Bfloat, kTiles, 4, KT>(d_hidden, shared.backward + Shape::kPackedDensity1,
                                 [&](int m, int i, const float (&s)[2][4]) {
#pragma unroll
      for (int block = 0; block < 2; ++block) {
        const int level = 4 * i + 2 * block + t / 2;  // four channels a level: two lanes
        if (level >= job.levels) continue;
#pragma unroll
        for (int half = 0; half < 2; ++half) {
          if (sample[m][half] >= n) continue;
          d_encoded[(std::size_t(level) * job.samples.most + sample[m][half]) * 2 + t % 2] =
              Bfloat::pack(s[block][2 * half], s[block][2 * half + 1]);
        }
      }
    });
    add_weight_gradient(d_density1, shared.gradient[1], out, shared.encoded, 8 * KT * part);
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

/// A weight's place among the optimiser's arrays.
struct Master {
  float *value, *first, *second;
};
__device__ Master master_of(const FieldUpdateJob& job, FieldWeight weight) {
  const int channels = 4 * job.levels;
  constexpr int kFeatures = kGeometryChannels + kSphericalHarmonics;
  int at = 0;
  switch (weight.layer) {
    case FieldLayer::kDensity1:
      at = weight.out * channels + weight.in;
      break;
    case FieldLayer::kDensity2:
      at = kHiddenWidth * channels + weight.out * kHiddenWidth + weight.in;
      break;
    case FieldLayer::kLuminance1:
      at = weight.out * kFeatures + weight.in;
      break;
    case FieldLayer::kLuminance2:
      at = kHiddenWidth * kFeatures + weight.out * kHiddenWidth + weight.in;
      break;
    case FieldLayer::kLuminance3:
      at = kHiddenWidth * (kFeatures + kHiddenWidth) + weight.in;
      break;
  }
  const bool of_density = weight.layer == FieldLayer::kDensity1 || weight.layer == FieldLayer::kDensity2;
  return of_density ? Master{job.density + at, job.density_first + at, job.density_second + at}
                    : Master{job.luminance + at, job.luminance_first + at, job.luminance_second + at};
}

template <int KT>
__device__ void pack_weight(const FieldUpdateJob& job, FieldWeight weight, float value) {
  using Shape = FieldShape<KT>;
  if (weight.layer == FieldLayer::kLuminance3) {
    job.last_layer[weight.in] = value;
    return;
  }
  int first = 0, inputs = 0, outputs = kHiddenWidth, backward_outputs = 0;
  switch (weight.layer) {
    case FieldLayer::kDensity1:
      first = Shape::kDensity1, inputs = backward_outputs = Shape::kEncoded;
      break;
    case FieldLayer::kDensity2:
      first = Shape::kDensity2, inputs = backward_outputs = kHiddenWidth, outputs = kGeometryChannels;
      break;
    case FieldLayer::kLuminance1:
      // Nobody asks for the gradient of the direction.
      first = Shape::kLuminance1, inputs = Shape::kFeatures, backward_outputs = kGeometryChannels;
      break;
    default:
      first = Shape::kLuminance2, inputs = backward_outputs = kHiddenWidth;
      break;
  }
  auto* forward = reinterpret_cast<__half*>(job.forward) + first;
  forward[packed_place(weight.in, weight.out, outputs)] = __float2half(value);
  if (weight.in >= backward_outputs) return;
  auto* backward = reinterpret_cast<__nv_bfloat16*>(job.backward) + first;
  backward[packed_place(weight.out, weight.in, backward_outputs)] = __float2bfloat16(value);
}

constexpr int kSlices = 8;  // threads that sum up one weight's parts

template <int KT>
__global__ void update(const FieldUpdateJob job) {
  using Shape = FieldShape<KT>;
  __shared__ float sums[kSlices][32];
  const int index = int(blockIdx.x) * 32 + int(threadIdx.x);  // kWeights is a multiple of 32
  if (job.d_weights != nullptr) {
    float sum = 0;
    for (int part = int(threadIdx.y); part < job.parts; part += kSlices) {
      sum += job.d_weights[std::size_t(part) * Shape::kWeights + index];
    }
    sums[threadIdx.y][threadIdx.x] = sum;
    __syncthreads();
  }
  if (threadIdx.y > 0) return;
  const FieldWeight weight = field_weight<KT>(index);
  if (weight.layer == FieldLayer::kDensity1 && weight.in >= 4 * job.levels) return;
  const Master master = master_of(job, weight);
  float value = *master.value;
  if (job.d_weights != nullptr) {
    float d = 0;
    for (int slice = 0; slice < kSlices; ++slice) d += sums[slice][threadIdx.x];
    job.adam->apply(AdamSettings{}, d, *master.first, *master.second, value);
    *master.value = value;
  }
  pack_weight<KT>(job, weight, value);
}

}  // namespace

int field_backward_blocks() {
  int device = 0, count = 0;
  CNERF_CUDA(cudaGetDevice(&device));
  CNERF_CUDA(cudaDeviceGetAttribute(&count, cudaDevAttrMultiProcessorCount, device));
  return count;
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
    CNERF_CUDA(cudaFuncSetAttribute(backward<KT>, cudaFuncAttributeMaxDynamicSharedMemorySize, kShared));
    backward<KT><<<unsigned(field_backward_blocks()), kThreads, kShared, stream>>>(job);
    CNERF_CUDA(cudaGetLastError());
  });
}

void field_update(const FieldUpdateJob& job, cudaStream_t stream) {
  with_channel_tiles(job.levels, [&](auto tiles) {
    constexpr int KT = decltype(tiles)::value;
    static_assert(FieldShape<KT>::kWeights % 32 == 0);
    update<KT><<<FieldShape<KT>::kWeights / 32, dim3(32, kSlices), 0, stream>>>(job);
    CNERF_CUDA(cudaGetLastError());
  });
}

}  // namespace cnerf
