#pragma once
/// A box of voxels stored in bricks of 8^3, of which only those that were written to exist. Not a VDB tree, because
/// rays look bricks up out of order: one index finds them, and the GPU gets the same layout.

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "src/base/check.h"
#include "src/base/host_device.h"
#include "src/base/vec3.h"

namespace cnerf::bake {

inline constexpr int kBrickSide = 8;
inline constexpr int kBrickVoxels = kBrickSide * kBrickSide * kBrickSide;

/// Position of a voxel inside its brick; `local` has components in [0, 8).
[[nodiscard]] CNERF_HD constexpr int brick_offset(Vec3i local) {
  return (local.x * kBrickSide + local.y) * kBrickSide + local.z;
}
[[nodiscard]] constexpr Vec3i brick_local(int offset) {
  return {offset / (kBrickSide * kBrickSide), offset / kBrickSide % kBrickSide, offset % kBrickSide};
}
// Of non-negative coordinates, which a signed division would not know.
static_assert(kBrickSide == 8);
[[nodiscard]] CNERF_HD constexpr Vec3i brick_part(Vec3i v) {
  return {v.x >> 3, v.y >> 3, v.z >> 3};
}
[[nodiscard]] CNERF_HD constexpr Vec3i local_part(Vec3i v) {
  return {v.x & 7, v.y & 7, v.z & 7};
}

/// Different bricks may be made and written by different threads; reading while another thread writes is not safe.
template <typename T>
class BrickGrid {
 public:
  /// Covers voxels [min, min + size); `background` is the value of whatever was never written.
  BrickGrid(Vec3i min, Vec3i size, T background) : min_(min), size_(size), background_(background) {
    CNERF_CHECK(size.x > 0 && size.y > 0 && size.z > 0, "a brick grid needs at least one voxel");
    for (int axis = 0; axis < 3; ++axis) counts_[axis] = (size[axis] + kBrickSide - 1) / kBrickSide;
    bricks_.resize(std::size_t(counts_.x) * counts_.y * counts_.z);
  }

  [[nodiscard]] Vec3i min() const { return min_; }
  [[nodiscard]] Vec3i size() const { return size_; }
  [[nodiscard]] Vec3i brick_counts() const { return counts_; }
  [[nodiscard]] std::size_t brick_count() const { return bricks_.size(); }
  [[nodiscard]] bool has_brick(std::size_t brick) const { return bricks_[brick] != nullptr; }

  /// First voxel of a brick.
  [[nodiscard]] Vec3i brick_min(std::size_t brick) const { return min_ + brick_coordinates(brick) * kBrickSide; }
  [[nodiscard]] Vec3i brick_coordinates(std::size_t brick) const {
    const auto b = std::ptrdiff_t(brick);
    const auto plane = std::ptrdiff_t(counts_.y) * counts_.z;
    return {int(b / plane), int(b / counts_.z % counts_.y), int(b % counts_.z)};
  }
  /// Number of the brick at brick coordinates inside [0, brick_counts()).
  [[nodiscard]] std::size_t brick_at(Vec3i c) const { return (std::size_t(c.x) * counts_.y + c.y) * counts_.z + c.z; }
  [[nodiscard]] bool contains(Vec3i voxel) const {
    const Vec3i v = voxel - min_;
    return v.x >= 0 && v.y >= 0 && v.z >= 0 && v.x < size_.x && v.y < size_.y && v.z < size_.z;
  }
  /// Number of the brick that holds a voxel of the box.
  [[nodiscard]] std::size_t brick_of(Vec3i voxel) const {
    const Vec3i v = voxel - min_;
    return brick_at(brick_part(v));
  }

  /// Value of any voxel; the background outside the box.
  [[nodiscard]] const T& at(Vec3i voxel) const {
    if (!contains(voxel)) return background_;
    const Vec3i v = voxel - min_;
    const auto& brick = bricks_[brick_at(brick_part(v))];
    return brick ? (*brick)[brick_offset(local_part(v))] : background_;
  }
  /// For tight loops: values of the brick around a voxel given relative to `min()`, nullptr where there is none.
  [[nodiscard]] const T* find_brick(Vec3i relative) const {
    const auto& brick = bricks_[brick_at(brick_part(relative))];
    return brick ? brick->data() : nullptr;
  }
  /// As ClearGrid says it; this one does not know.
  [[nodiscard]] static int clear_bricks(Vec3i /*relative*/) { return 0; }
  void set(Vec3i voxel, const T& value) {
    CNERF_CHECK(contains(voxel), "voxel outside the brick grid");
    const Vec3i v = voxel - min_;
    make_brick(brick_of(voxel))[brick_offset(local_part(v))] = value;
  }
  /// The values of a brick, made of background if it did not exist.
  std::array<T, kBrickVoxels>& make_brick(std::size_t brick) {
    if (!bricks_[brick]) {
      bricks_[brick] = std::make_unique<std::array<T, kBrickVoxels>>();
      bricks_[brick]->fill(background_);
    }
    return *bricks_[brick];
  }
  /// The values of a brick that exists.
  [[nodiscard]] const std::array<T, kBrickVoxels>& brick(std::size_t brick) const { return *bricks_[brick]; }

 private:
  Vec3i min_, size_, counts_;
  T background_;
  std::vector<std::unique_ptr<std::array<T, kBrickVoxels>>> bricks_;
};

/// For every brick: whether it or one of its 26 neighbours exists.
template <typename T>
[[nodiscard]] std::vector<char> bricks_with_neighbours(const BrickGrid<T>& grid) {
  std::vector<char> near(grid.brick_count(), 0);
  const Vec3i counts = grid.brick_counts();
  for (std::size_t b = 0; b < grid.brick_count(); ++b) {
    if (!grid.has_brick(b)) continue;
    const Vec3i c = grid.brick_coordinates(b);
    for (int x = std::max(0, c.x - 1); x <= std::min(counts.x - 1, c.x + 1); ++x)
      for (int y = std::max(0, c.y - 1); y <= std::min(counts.y - 1, c.y + 1); ++y)
        for (int z = std::max(0, c.z - 1); z <= std::min(counts.z - 1, c.z + 1); ++z)
          near[grid.brick_at({x, y, z})] = 1;
  }
  return near;
}

}  // namespace cnerf::bake
