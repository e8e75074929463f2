#pragma once
/// Marching by a warp: as many points of the ray's lattice as it has lanes are looked up at once, what is occupied
/// queues up until there is a sample for every lane.

#include <cstdint>

#include "src/base/cuda/warp.cuh"
#include "src/render/cuda/ray_record.h"
#include "src/render/march.h"
#include "src/render/occupancy_math.h"

namespace cnerf {

struct OccupiedSpace {
  OccupancyLayout layout;
  const std::uint32_t* bits;  ///< one per cell

  __device__ bool holds(Vec3f p) const {
    const std::size_t cell = layout.cell_of(layout.cascade_of(p), p);
    return (__ldg(bits + cell / 32) >> (cell % 32)) & 1u;
  }
};

/// Shared memory of one warp.
struct MarchQueue {
  float t[64];
};

/// A ray's samples.
/// @tparam kLanes  lanes that share a ray: 32, or 16 where a warp follows two
template <int kLanes = 32>
class WarpMarcher {
 public:
  WarpMarcher() = default;
  __device__ WarpMarcher(const OccupiedSpace& space, const MarchSettings& settings, const RayRecord& record)
      : lattice_(settings, record.begin, record.jitter), ray_(record.ray), end_(record.end), space_(&space) {}

  /// Hands out the next samples of the ray, one per lane; returns how many there are, 0 at the ray's end.
  /// @param wanted  whether this lane's group wants any; the whole warp calls the function
  __device__ int next(RaySample& sample, MarchQueue& warp_queue, bool wanted = true) {
    const unsigned lane = threadIdx.x % kLanes;
    float* queue = warp_queue.t + threadIdx.x % 32 / kLanes * (2 * kLanes);
    while (true) {
      const bool looks = wanted && queued_ < kLanes && lattice_.t_at(index_) < end_;
      if (!__any_sync(~0u, looks)) break;
      const float t = lattice_.t_at(index_ + int(lane));
      const bool occupied = looks && t < end_ && space_->holds(ray_.at(t));
      const unsigned lanes = warp_ballot<kLanes>(occupied);
      if (occupied) queue[queued_ + __popc(lanes & ((1u << lane) - 1u))] = t;
      queued_ += __popc(lanes);
      if (looks) index_ += kLanes;
    }
    __syncwarp();
    const int count = wanted ? min(queued_, kLanes) : 0;
    if (wanted) {
      sample.t = int(lane) < count ? queue[lane] : 0.0f;
      sample.dt = lattice_.step(sample.t);
    }
    const float kept = int(lane) < queued_ - count ? queue[count + int(lane)] : 0.0f;
    __syncwarp();
    queue[lane] = kept;
    queued_ -= count;
    __syncwarp();
    return count;
  }

 private:
  MarchLattice lattice_;
  Ray ray_;
  float end_ = -1;
  const OccupiedSpace* space_ = nullptr;
  int index_ = 0, queued_ = 0;
};

}  // namespace cnerf
