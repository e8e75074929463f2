#include <algorithm>
#include <memory>
#include <mutex>

#include "bake/visibility/cuda/sight_kernel.h"
#include "bake/visibility/view_selection.h"
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

/// ViewSelection for many points at once.
class ViewSelectionCuda final : public ViewSelection {
 public:
  ViewSelectionCuda(const std::vector<Camera>& cameras, std::vector<DensityLevel> levels, const Options& options);
  void find(std::size_t level, const SightBatch& batch, SeenBatch& answer) const override;

 private:
  std::vector<LevelMemory> bricks_;
  DeviceBuffer<DeviceBricks> grids_;
  DeviceBuffer<SightLevel<DeviceBricks>> levels_;
  DeviceBuffer<float> depths_;
  DeviceBuffer<Eye> eyes_;
  SightScene<DeviceBricks> scene_;
  // Of a question.
  mutable std::mutex mutex_;
  mutable DeviceBuffer<Sight> sights_;
  mutable DeviceBuffer<std::int32_t> orders_, counts_;
  mutable DeviceBuffer<SeenBy> seen_;
};

ViewSelectionCuda::ViewSelectionCuda(const std::vector<Camera>& cameras, std::vector<DensityLevel> levels,
                                     const Options& options)
    : ViewSelection(cameras, std::move(levels), options) {
  const SightScene<BrickGrid<float>> host = scene();
  std::vector<DeviceBricks> grids;
  for (int i = 0; i < host.level_count; ++i) {
    const BrickGrid<float>& sigma = *host.levels[i].sigma;
    CNERF_CHECK(sigma.min() == Vec3i{}, "the lattice of a bake starts at 0");
    const LevelMemory& bricks = bricks_.emplace_back(uploaded_bricks(sigma));
    grids.push_back({bricks.numbers.data(), bricks.values.data(), sigma.size(), sigma.brick_counts()});
  }
  grids_ = uploaded(grids, kAdvice);
  std::vector<SightLevel<DeviceBricks>> on_device;
  for (int i = 0; i < host.level_count; ++i) {
    on_device.push_back({grids_.data() + i, host.levels[i].origin, host.levels[i].voxel_size});
  }
  levels_ = uploaded(on_device, kAdvice);
  map_depths();
  depths_ = uploaded(depth_maps().values(), kAdvice);
  std::vector<Eye> on_its_maps = eyes();
  for (std::size_t e = 0; e < on_its_maps.size(); ++e) on_its_maps[e].depths = depth_maps().map(e, depths_.data());
  eyes_ = uploaded(on_its_maps, kAdvice);
  scene_ = {eyes_.data(), host.eye_count, levels_.data(), host.level_count, host.views};
}

void ViewSelectionCuda::find(std::size_t level, const SightBatch& batch, SeenBatch& answer) const {
  const std::size_t count = batch.sights.size(), views = std::size_t(views_per_voxel());
  answer.seen.resize(count * views);
  answer.counts.resize(count);
  const std::lock_guard lock(mutex_);
  sights_.reserve(count, kPointAdvice);
  counts_.reserve(count, kPointAdvice);
  seen_.reserve(count * views, kPointAdvice);
  orders_.reserve(batch.orders.size(), kPointAdvice);
  sights_.upload(batch.sights.data(), count, nullptr);
  orders_.upload(batch.orders.data(), batch.orders.size(), nullptr);
  find_seeing_all(
      {scene_, int(level), sights_.data(), orders_.data(), std::uint32_t(count), seen_.data(), counts_.data()},
      nullptr);
  counts_.download(answer.counts.data(), count, nullptr);
  seen_.download(answer.seen.data(), count * views, nullptr);
  CNERF_CUDA(cudaStreamSynchronize(nullptr));
}

}  // namespace

std::unique_ptr<ViewSelection> make_view_selection_cuda(const std::vector<Camera>& cameras,
                                                        const std::vector<DensityLevel>& levels,
                                                        const Options& options) {
  return std::make_unique<ViewSelectionCuda>(cameras, levels, options);
}

}  // namespace cnerf::bake
