#include "bake/visibility/cuda/view_selection_cuda.h"

#include <algorithm>
#include <mutex>

#include "bake/visibility/cuda/sight_kernel.h"
#include "src/base/check.h"
#include "src/base/cuda/device_memory.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

constexpr std::size_t kBricksAtATime = 1 << 14;  // 32 MiB on their way
const char* const kAdvice = "the density of the bake; lower bake.resolution or cut the box with bake.aabb";
const char* const kPointAdvice = "who sees voxels; lower bake.views_per_voxel";

struct LevelMemory {
  DeviceBuffer<std::int32_t> numbers;
  DeviceBuffer<float> values;
};

/// The bricks that exist, one behind the other.
LevelMemory uploaded_bricks(const BrickGrid<float>& sigma) {
  std::vector<std::int32_t> numbers(sigma.brick_count(), -1);
  std::vector<std::size_t> existing;
  for (std::size_t b = 0; b < sigma.brick_count(); ++b) {
    if (!sigma.has_brick(b)) continue;
    numbers[b] = std::int32_t(existing.size());
    existing.push_back(b);
  }
  LevelMemory memory{uploaded(numbers, kAdvice), {existing.size() * kBrickVoxels, kAdvice}};
  std::vector<float> staged(std::min(existing.size(), kBricksAtATime) * kBrickVoxels);
  for (std::size_t first = 0; first < existing.size(); first += kBricksAtATime) {
    const std::size_t count = std::min(kBricksAtATime, existing.size() - first);
    parallel_tasks(count, [&](std::size_t b) {
      const auto& brick = sigma.brick(existing[first + b]);
      std::copy(brick.begin(), brick.end(), staged.begin() + std::ptrdiff_t(b * kBrickVoxels));
    });
    CNERF_CUDA(cudaMemcpy(memory.values.data() + first * kBrickVoxels, staged.data(),
                          count * kBrickVoxels * sizeof(float), cudaMemcpyHostToDevice));
  }
  return memory;
}

}  // namespace

struct ViewSelectionCuda::Memory {
  std::vector<LevelMemory> bricks;
  DeviceBuffer<DeviceBricks> grids;
  DeviceBuffer<SightLevel<DeviceBricks>> levels;
  DeviceBuffer<Eye> eyes;
  SightScene<DeviceBricks> scene;
  // Of a question.
  std::mutex mutex;
  DeviceBuffer<Sight> sights;
  DeviceBuffer<std::int32_t> orders, counts;
  DeviceBuffer<SeenBy> seen;
};

ViewSelectionCuda::ViewSelectionCuda(const std::vector<Camera>& cameras, std::vector<DensityLevel> levels,
                                     const Options& options)
    : ViewSelection(cameras, std::move(levels), options), memory_(std::make_unique<Memory>()) {
  Memory& m = *memory_;
  const SightScene<BrickGrid<float>> host = scene();
  std::vector<DeviceBricks> grids;
  for (int i = 0; i < host.level_count; ++i) {
    const BrickGrid<float>& sigma = *host.levels[i].sigma;
    CNERF_CHECK(sigma.min() == Vec3i{}, "the lattice of a bake starts at 0");
    const LevelMemory& bricks = m.bricks.emplace_back(uploaded_bricks(sigma));
    grids.push_back({bricks.numbers.data(), bricks.values.data(), sigma.size(), sigma.brick_counts()});
  }
  m.grids = uploaded(grids, kAdvice);
  std::vector<SightLevel<DeviceBricks>> on_device;
  for (int i = 0; i < host.level_count; ++i) {
    on_device.push_back({m.grids.data() + i, host.levels[i].origin, host.levels[i].voxel_size});
  }
  m.levels = uploaded(on_device, kAdvice);
  m.eyes = uploaded(eyes(), kAdvice);
  m.scene = {m.eyes.data(), host.eye_count, m.levels.data(), host.level_count, host.views, host.seen_transmittance};
}

ViewSelectionCuda::~ViewSelectionCuda() = default;

void ViewSelectionCuda::find(std::size_t level, const SightBatch& batch, SeenBatch& answer) const {
  const std::size_t count = batch.sights.size(), views = std::size_t(views_per_voxel());
  answer.seen.resize(count * views);
  answer.counts.resize(count);
  Memory& m = *memory_;
  const std::lock_guard lock(m.mutex);
  m.sights.reserve(count, kPointAdvice);
  m.counts.reserve(count, kPointAdvice);
  m.seen.reserve(count * views, kPointAdvice);
  m.orders.reserve(batch.orders.size(), kPointAdvice);
  m.sights.upload(batch.sights.data(), count, nullptr);
  m.orders.upload(batch.orders.data(), batch.orders.size(), nullptr);
  find_seeing_all(
      {m.scene, int(level), m.sights.data(), m.orders.data(), std::uint32_t(count), m.seen.data(), m.counts.data()},
      nullptr);
  m.counts.download(answer.counts.data(), count, nullptr);
  m.seen.download(answer.seen.data(), count * views, nullptr);
  CNERF_CUDA(cudaStreamSynchronize(nullptr));
}

}  // namespace cnerf::bake
