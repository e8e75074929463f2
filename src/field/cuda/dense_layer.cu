#include "src/field/cuda/dense_layer.h"

#include <cuda_bf16.h>
#include <cuda_fp16.h>

#include "src/base/check.h"
#include "src/base/cuda/device_memory.h"

namespace cnerf {
namespace {

constexpr int kMostLayers = 5;
constexpr int kColumns = 32;  // weights of a block; layers have a multiple of them
constexpr int kSlices = 8;    // threads that sum up one weight's parts

struct UpdateJob {
  DenseLayer layer[kMostLayers];
  int weights;  // of all layers, padded
  const float* d_weights;
  int parts;
  const AdamStep* adam;
};

__device__ void pack(const DenseLayer& layer, int out, int in, float value) {
  if (layer.plain != nullptr) layer.plain[out * layer.padded_inputs + in] = value;
  if (layer.forward != nullptr) {
    reinterpret_cast<__half*>(layer.forward)[packed_place(in, out, layer.padded_outputs)] = __float2half(value);
  }
  if (layer.backward != nullptr && in < layer.backward_inputs) {
    reinterpret_cast<__nv_bfloat16*>(layer.backward)[packed_place(out, in, layer.backward_inputs)] =
        __float2bfloat16(value);
  }
}

using SliceSums = float[kSlices][kColumns];

/// Of the parts of a weight's gradient, what the threads of its column find.
__device__ void sum_slices(const float* d_weights, int parts, int weights, int index, SliceSums& sums) {
  float sum = 0;
  for (int part = int(threadIdx.y); part < parts; part += kSlices)
    sum += d_weights[std::size_t(part) * weights + index];
  sums[threadIdx.y][threadIdx.x] = sum;
  __syncthreads();
}
__device__ float sum_of(const SliceSums& sums) {
  float sum = 0;
  for (int slice = 0; slice < kSlices; ++slice) sum += sums[slice][threadIdx.x];
  return sum;
}

__global__ void sum_parts(const float* d_weights, int parts, int weights, float* to) {
  __shared__ SliceSums sums;
  const int index = int(blockIdx.x) * kColumns + int(threadIdx.x);
  sum_slices(d_weights, parts, weights, index, sums);
  if (threadIdx.y == 0) to[index] = sum_of(sums);
}

__global__ void update(const __grid_constant__ UpdateJob job) {
  __shared__ SliceSums sums;
  int index = int(blockIdx.x) * kColumns + int(threadIdx.x);
  if (job.d_weights != nullptr) sum_slices(job.d_weights, job.parts, job.weights, index, sums);
  if (threadIdx.y > 0) return;
  const DenseLayer* layer = job.layer;
  for (; index >= layer->padded_outputs * layer->padded_inputs; ++layer) {
    index -= layer->padded_outputs * layer->padded_inputs;
  }
  const int out = index / layer->padded_inputs, in = index % layer->padded_inputs;
  if (out >= layer->outputs || in >= layer->inputs) return;
  const int at = out * layer->inputs + in;
  const TrainedWeights& trained = layer->trained;
  float value = trained.values[at];
  if (job.d_weights != nullptr) {
    job.adam->apply(sum_of(sums), trained.first_moments[at], trained.second_moments[at], value);
    trained.values[at] = value;
  }
  pack(*layer, out, in, value);
}

}  // namespace

void update_layers(const std::vector<DenseLayer>& layers, const float* d_weights, int parts, const AdamStep* adam,
                   cudaStream_t stream) {
  CNERF_CHECK(layers.size() <= kMostLayers, "nets of one update have at most five layers");
  UpdateJob job{{}, 0, d_weights, parts, adam};
  for (std::size_t l = 0; l < layers.size(); ++l) {
    job.layer[l] = layers[l];
    job.weights += layers[l].padded_outputs * layers[l].padded_inputs;
  }
  CNERF_CHECK(job.weights % kColumns == 0, "padded layers are multiples of 16 by 16, or rows of 64");
  update<<<unsigned(job.weights / kColumns), dim3(kColumns, kSlices), 0, stream>>>(job);
  CNERF_CUDA(cudaGetLastError());
}

void sum_gradient_parts(const float* d_weights, int parts, int weights, float* sum, cudaStream_t stream) {
  CNERF_CHECK(weights % kColumns == 0, "padded layers are multiples of 16 by 16, or rows of 64");
  sum_parts<<<unsigned(weights / kColumns), dim3(kColumns, kSlices), 0, stream>>>(d_weights, parts, weights, sum);
  CNERF_CUDA(cudaGetLastError());
}

void sum_gradient_parts(float* d_weights, int parts, int weights, DeviceSums& sums, cudaStream_t stream) {
  sum_gradient_parts(d_weights, parts, weights, d_weights, stream);  // who writes a number has read its parts
  sums.sum(std::span(d_weights, std::size_t(weights)), stream);
}

}  // namespace cnerf
