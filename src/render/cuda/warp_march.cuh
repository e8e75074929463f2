#pragma once
/// Marching by a warp: 32 points of the ray's lattice are looked up at once, what is occupied queues up until there is a
/// sample for every lane.

#include <cstdint>

#include "src/render/cuda/ray_record.h"
#include "src/render/march_lattice.h"
#include "src/render/occupancy_layout.h"

namespace cnerf {

struct OccupiedSpace {
  OccupancyLayout layout;
  const std::uint32_t* bits;  ///< one a cell

  __device__ bool holds(Vec3f p) const {
    const std::size_t cell = layout.cell_of(layout.cascade_of(p), p);
    return (__ldg(bits + cell / 32) >> (cell % 32)) & 1u;
  }
};

/// Shared memory of one warp.
struct MarchQueue {
  float t[64];
};

class WarpMarcher {
 public:
  __device__ WarpMarcher(const OccupiedSpace& space, const MarchSettings& settings, const RayRecord& record,
                         MarchQueue& queue)
      : space_(space), queue_(queue), lattice_(settings, record.begin, record.jitter), ray_(record.ray),
        end_(record.end) {}

  /// Hands out the next samples of the ray, one a lane; returns how many there are, 0 at the ray's end.
  __device__ int next(RaySample& sample) {
    const unsigned lane = threadIdx.x % 32;
    while (queued_ < 32 && lattice_.t_at(index_) < end_) {
      const float t = lattice_.t_at(index_ + int(lane));
      const bool occupied = t < end_ && space_.holds(ray_.at(t));
      const unsigned lanes = __ballot_sync(~0u, occupied);
      if (occupied) queue_.t[queued_ + __popc(lanes & ((1u << lane) - 1u))] = t;
      queued_ += __popc(lanes);
      index_ += 32;
    }
    __syncwarp();
    const int count = min(queued_, 32);
    sample.t = int(lane) < count ? queue_.t[lane] : 0.0f;
    sample.dt = lattice_.step(sample.t);
    const float kept = int(lane) < queued_ - count ? queue_.t[32 + lane] : 0.0f;
    __syncwarp();
    queue_.t[lane] = kept;
    queued_ -= count;
    __syncwarp();
    return count;
  }

 private:
  const OccupiedSpace& space_;
  MarchQueue& queue_;
  MarchLattice lattice_;
  Ray ray_;
  float end_;
  int index_ = 0, queued_ = 0;
};

}  // namespace cnerf
