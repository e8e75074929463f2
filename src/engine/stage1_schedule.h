#pragma once
/// What a step of stage 1 does when, once for every device: how many rays it takes, when it visits the occupancy grid.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "src/base/host_device.h"
#include "src/base/rng.h"
#include "src/render/occupancy_math.h"

namespace cnerf {

inline constexpr float kTrainingTransmittance = 1e-4f;  ///< a training ray ends below this

/// How much known depths weigh in a step: less and less, since they are rougher than what pictures tell.
struct DepthLearning {
  float weight = 0;       ///< in the loss, of the first step; 0: depths are not looked at
  float half_life = 500;  ///< steps

  /// 0 after ten halvings: what is left by then is not worth its time.
  [[nodiscard]] CNERF_HD float weight_at(std::int64_t step) const {
    const float halvings = float(step) / half_life;
    return weight <= 0 || halvings > 10 ? 0.0f : weight * std::exp2(-halvings);
  }
};

inline constexpr std::int64_t kFewestRays = 64, kMostRays = 1 << 16;  ///< of a step
inline constexpr int kMostSamplesOfRay = 1024;                        ///< what is behind them is not looked at

/// Rays of the first step: 256 samples each is a guess that later steps correct.
[[nodiscard]] inline std::int64_t first_rays(int samples_per_step) {
  return std::clamp<std::int64_t>(samples_per_step / 256, kFewestRays, kMostRays);
}

/// As many rays in the next step as fill the wanted number of samples: a multiple of 16, at most twice as many as in
/// this one and at least half of them.
/// @param rays, samples  of this step
[[nodiscard]] CNERF_HD inline std::int64_t next_rays(std::int64_t rays, std::int64_t samples,
                                                     std::int64_t wanted_samples) {
  const double fill = double(wanted_samples) / double(samples < 64 ? 64 : samples);
  const auto next = std::int64_t(double(rays) * (fill < 0.5 ? 0.5 : fill > 2.0 ? 2.0 : fill)) / 16 * 16;
  return next < kFewestRays ? kFewestRays : next > kMostRays ? kMostRays : next;
}

/// A process's range of a step's rays, in whole blocks of those that teach poses together: the first one and the one
/// behind the last.
struct RayRange {
  std::uint32_t first = 0, last = 0;
};
[[nodiscard]] CNERF_HD inline RayRange part_of_rays(std::uint32_t rays, int part, int parts) {
  constexpr std::uint32_t kBlock = 16;
  const std::uint32_t blocks = (rays + kBlock - 1) / kBlock;
  const std::uint32_t first = blocks * std::uint32_t(part) / std::uint32_t(parts) * kBlock;
  const std::uint32_t last = blocks * std::uint32_t(part + 1) / std::uint32_t(parts) * kBlock;
  return {first < rays ? first : rays, last < rays ? last : rays};
}

inline constexpr long kOccupancyEvery = 16;    ///< steps between updates of the occupancy grid
inline constexpr long kOccupancyWarmUp = 256;  ///< steps during which an update visits a quarter of the cells

/// Whether the grid is updated before a step.  @param step  steps done
[[nodiscard]] inline bool updates_occupancy(long step) {
  return step % kOccupancyEvery == 0;
}
/// All cells at first, a quarter of them while the scene takes shape, then a sixteenth.
[[nodiscard]] inline OccupancyUpdate occupancy_update(long step, std::uint64_t seed) {
  const auto update = std::size_t(step / kOccupancyEvery);
  const std::size_t stride = step == 0 ? 1 : step < kOccupancyWarmUp ? 4 : 16;
  return {stride, update % stride, seed ^ mix_bits(update)};
}

}  // namespace cnerf
