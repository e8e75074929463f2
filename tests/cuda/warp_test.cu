// What lanes of a warp do together, against one after the other.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "src/base/cuda/device_memory.h"
#include "src/base/cuda/launch.h"
#include "src/base/cuda/warp.cuh"
#include "src/base/rng.h"
#include "src/engine/luminance_engine.h"

namespace cnerf::test {
namespace {

struct SegmentSum {
  float sum;
  bool is_first;
};

__global__ void sum_segments(const std::uint32_t* keys, const float* values, SegmentSum* sums) {
  const unsigned at = blockIdx.x * 32 + threadIdx.x;
  const WarpSegment segment(keys[at]);
  sums[at] = {segment.sum(values[at]), segment.is_first()};
}

TEST(Warp, ASegmentIsOfNeighboursOnly) {
  if (!has_cuda_device()) GTEST_SKIP() << "no GPU that can be used";
  constexpr std::size_t kWarps = 500, kLanes = 32 * kWarps;
  SequentialRng rng(3, 1);
  std::vector<std::uint32_t> keys;
  std::vector<float> values;
  while (keys.size() < kLanes) {
    const auto length = std::size_t(rng.uniform(1, 13));
    keys.insert(keys.end(), length, std::uint32_t(rng.uniform(0, 3)));
  }
  keys.resize(kLanes);
  for (std::size_t i = 0; i < kLanes; ++i) values.push_back(std::floor(rng.uniform(0, 1000)));
  DeviceBuffer<std::uint32_t> keys_there(kLanes, "keys");
  DeviceBuffer<float> values_there(kLanes, "values");
  DeviceBuffer<SegmentSum> sums_there(kLanes, "sums");
  keys_there.upload(keys.data(), kLanes);
  values_there.upload(values.data(), kLanes);
  sum_segments<<<kWarps, 32>>>(keys_there.data(), values_there.data(), sums_there.data());
  CNERF_CUDA(cudaGetLastError());
  const std::vector<SegmentSum> sums = sums_there.downloaded();
  for (std::size_t warp = 0; warp < kLanes; warp += 32) {
    for (std::size_t first = warp; first < warp + 32;) {
      const auto rest = keys.begin() + std::ptrdiff_t(first);
      const auto end =
          std::find_if(rest, keys.begin() + std::ptrdiff_t(warp + 32), [&](std::uint32_t key) { return key != *rest; });
      float sum = 0;
      for (std::size_t i = first; i < std::size_t(end - keys.begin()); ++i) {
        sum += values[i];
        EXPECT_EQ(sums[i].is_first, i == first) << i;
      }
      EXPECT_EQ(sums[first].sum, sum) << first;
      first = std::size_t(end - keys.begin());
    }
  }
}

}  // namespace
}  // namespace cnerf::test
