#include "encoding/cuda/hash_grid_device.cuh"
#include "src/base/cuda/launch.h"
#include "src/optim/cuda/row_adam_cuda.h"

namespace cnerf {
namespace {

constexpr unsigned kThreads = 128;

__global__ void update(const TableRowsCuda rows, const AdamStep* adam, float decay) {
  const std::uint32_t row = blockIdx.x * kThreads + threadIdx.x;
  if (row >= rows.count) return;
  const float4 d = rows.gradient[row];
  if (d.x == 0 && d.y == 0 && d.z == 0 && d.w == 0) return;
  const AdamStep step = *adam;
  const float kept = step.kept(decay);
  float4* moments = rows.moments + 2 * std::size_t(row);
  float4 value = rows.values[row], first = moments[0], second = moments[1];
  step.apply(d.x, first.x, second.x, value.x, kept);
  step.apply(d.y, first.y, second.y, value.y, kept);
  step.apply(d.z, first.z, second.z, value.z, kept);
  step.apply(d.w, first.w, second.w, value.w, kept);
  rows.values[row] = value;
  moments[0] = first;
  moments[1] = second;
  rows.gradient[row] = make_float4(0, 0, 0, 0);
  rows.halves[row] = halves_of(value);
}

__global__ void round(const TableRowsCuda rows) {
  const std::uint32_t row = blockIdx.x * kThreads + threadIdx.x;
  if (row < rows.count) rows.halves[row] = halves_of(rows.values[row]);
}

}  // namespace

void update_rows(const TableRowsCuda& rows, const AdamStep* adam, float decay, cudaStream_t stream) {
  update<<<blocks_for(rows.count, kThreads), kThreads, 0, stream>>>(rows, adam, decay);
  CNERF_CUDA(cudaGetLastError());
}

void round_rows(const TableRowsCuda& rows, cudaStream_t stream) {
  round<<<blocks_for(rows.count, kThreads), kThreads, 0, stream>>>(rows);
  CNERF_CUDA(cudaGetLastError());
}

}  // namespace cnerf
