#pragma once
/// What a training step knows about itself, on the GPU.

#include <cstdint>

#include "src/optim/adam.h"

namespace cnerf {

struct StepState {
  std::int64_t step = 0;       ///< steps done
  std::uint32_t rays = 0;      ///< of this step
  std::uint32_t next_ray = 0;  ///< not yet taken by a warp
  std::uint32_t samples = 0;   ///< allocated; may exceed the capacity
  std::uint32_t dropped = 0;   ///< rays that found no room
  double loss = 0, squared_error = 0;
  unsigned long long marched = 0;
  AdamStep adam;
};

}  // namespace cnerf
