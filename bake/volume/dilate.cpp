#include "bake/volume/dilate.h"

#include <algorithm>
#include <array>
#include <memory>
#include <numeric>
#include <optional>
#include <tuple>

#include "bake/lattice/brick_grid.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

// What the index grid says of a place: the index of a voxel with density, or one of these.
constexpr std::int32_t kMissing = -1;
constexpr std::int32_t kColorOnly = -2;

/// Squared distance from density, in voxels, at which trilinear interpolation no longer mixes in a voxel's colour.
constexpr int kBeyondInterpolation = 4;

using IndexGrid = BrickGrid<std::int32_t>;

/// The voxels of one plane of bricks, found by place.
struct IndexedPlane {
  int plane = 0;
  std::vector<Voxel> voxels;
  std::optional<IndexGrid> grid;  ///< none when the plane is empty
};

IndexedPlane indexed(int plane, std::vector<Voxel> voxels) {
  IndexedPlane indexed{plane, std::move(voxels), {}};
  if (indexed.voxels.empty()) return indexed;
  const VoxelBox box = bounding_box(indexed.voxels);
  Vec3i low = box.min, high = box.min + box.size;
  for (int axis = 0; axis < 3; ++axis) low[axis] &= ~(kBrickSide - 1);  // bricks are the leaves of a VDB
  indexed.grid.emplace(low, high - low, kMissing);
  for (std::size_t v = 0; v < indexed.voxels.size(); ++v) {
    const Voxel& voxel = indexed.voxels[v];
    const Vec3i at{voxel.i, voxel.j, voxel.k};
    CNERF_CHECK(indexed.grid->at(at) == kMissing, "two baked voxels share a place");
    indexed.grid->set(at, voxel.sigma > 0 ? std::int32_t(v) : kColorOnly);
  }
  return indexed;
}

/// A plane of bricks between its neighbours.
class PlaneWindow {
 public:
  explicit PlaneWindow(const VolumePlanes& source) : source_(source) {}

  /// Moves to another plane; what stays in sight is not read again.
  void move_to(int plane) {
    std::array<std::shared_ptr<const IndexedPlane>, 3> next;
    for (int n = 0; n < 3; ++n) {
      for (const auto& known : planes_) {
        if (known && known->plane == plane + n - 1) next[n] = known;
      }
      if (!next[n]) next[n] = std::make_shared<IndexedPlane>(indexed(plane + n - 1, source_.read(plane + n - 1)));
    }
    planes_ = next;
  }
  [[nodiscard]] const IndexedPlane& middle() const { return *planes_[1]; }

  /// Bricks of the middle plane that may have density within eight voxels: their (y, z) as box of voxels.
  [[nodiscard]] VoxelBox reach() const {
    VoxelBox box;
    Vec3i low, high;
    bool any = false;
    for (const auto& plane : planes_) {
      if (!plane->grid) continue;
      const Vec3i from = plane->grid->min(), to = from + plane->grid->size();
      for (int axis = 1; axis < 3; ++axis) {
        low[axis] = any ? std::min(low[axis], from[axis]) : from[axis];
        high[axis] = any ? std::max(high[axis], to[axis]) : to[axis];
      }
      any = true;
    }
    if (!any) return box;
    box.min = {kBrickSide * middle().plane, low.y - kBrickSide, low.z - kBrickSide};
    box.size = {kBrickSide, high.y - low.y + 2 * kBrickSide, high.z - low.z + 2 * kBrickSide};
    return box;
  }
  /// Whether a brick of the middle plane or one of its neighbours holds voxels.
  [[nodiscard]] bool is_touched(Vec3i brick_min) const {
    for (const auto& plane : planes_) {
      if (!plane->grid) continue;
      for (int y = -1; y <= 1; ++y) {
        for (int z = -1; z <= 1; ++z) {
          const Vec3i at{plane->grid->min().x, brick_min.y + kBrickSide * y, brick_min.z + kBrickSide * z};
          if (plane->grid->contains(at) && plane->grid->has_brick(plane->grid->brick_of(at))) return true;
        }
      }
    }
    return false;
  }
  [[nodiscard]] bool is_missing(Vec3i voxel) const {
    const IndexedPlane& plane = plane_of(voxel);
    return !plane.grid || plane.grid->at(voxel) == kMissing;
  }
  /// What the index grid says of a brick's voxels, by offset; nullptr where none was ever written.
  [[nodiscard]] const std::int32_t* brick_at(Vec3i brick_min) const {
    const IndexedPlane& plane = plane_of(brick_min);
    if (!plane.grid || !plane.grid->contains(brick_min)) return nullptr;
    return plane.grid->find_brick(brick_min - plane.grid->min());
  }
  /// The voxel there if it has density.
  [[nodiscard]] const Voxel* dense_at(Vec3i voxel) const {
    const IndexedPlane& plane = plane_of(voxel);
    if (!plane.grid) return nullptr;
    const std::int32_t index = plane.grid->at(voxel);
    return index >= 0 ? &plane.voxels[index] : nullptr;
  }

 private:
  [[nodiscard]] const IndexedPlane& plane_of(Vec3i voxel) const { return *planes_[(voxel.x >> 3) - planes_[0]->plane]; }

  VolumePlanes source_;
  std::array<std::shared_ptr<const IndexedPlane>, 3> planes_;
};

/// All offsets of the cube of this radius, nearest first.
std::vector<Vec3i> offsets_by_distance(int radius) {
  std::vector<Vec3i> offsets;
  for (int x = -radius; x <= radius; ++x)
    for (int y = -radius; y <= radius; ++y)
      for (int z = -radius; z <= radius; ++z) offsets.push_back({x, y, z});
  std::stable_sort(offsets.begin(), offsets.end(), [](Vec3i a, Vec3i b) { return dot(a, a) < dot(b, b); });
  return offsets;
}

/// Which voxels of a brick have density within `radius`: a box dilation, one axis after the other. Rows along z are
/// bits.
class NearDensity {
 public:
  NearDensity(const PlaneWindow& window, Vec3i brick_min, int radius)
      : radius_(radius), side_(kBrickSide + 2 * radius), rows_(std::size_t(side_) * side_) {
    for (int neighbour = 0; neighbour < 27; ++neighbour) {
      const Vec3i step{neighbour / 9 - 1, neighbour / 3 % 3 - 1, neighbour % 3 - 1};
      const std::int32_t* brick = window.brick_at(brick_min + step * kBrickSide);
      if (brick != nullptr) look_into(brick, step * kBrickSide);
    }
    for (std::uint32_t& row : rows_) row = along_row(row);
    spread_rows(1, side_);
    spread_rows(side_, 1);
  }
  [[nodiscard]] bool operator()(Vec3i local) const {
    return (row(local.x + radius_, local.y + radius_) >> (local.z + radius_) & 1) != 0;
  }

 private:
  static_assert(kBrickSide + 2 * kBrickSide <= 32, "the widest row");

  [[nodiscard]] const std::uint32_t& row(int x, int y) const { return rows_[std::size_t(x) * side_ + y]; }
  /// @param low  first voxel of the brick, from the first of the one in the middle
  void look_into(const std::int32_t* brick, Vec3i low) {
    Vec3i from, to;  // of the brick's voxels, those within `radius_` of the middle
    for (int axis = 0; axis < 3; ++axis) {
      from[axis] = std::max(0, -radius_ - low[axis]);
      to[axis] = std::min(kBrickSide, kBrickSide + radius_ - low[axis]);
    }
    for (int x = from.x; x < to.x; ++x) {
      for (int y = from.y; y < to.y; ++y) {
        std::uint32_t bits = 0;
        for (int z = from.z; z < to.z; ++z) {
          bits |= std::uint32_t(brick[brick_offset({x, y, z})] >= 0) << (z + low.z + radius_);
        }
        rows_[std::size_t(x + low.x + radius_) * side_ + (y + low.y + radius_)] |= bits;
      }
    }
  }
  [[nodiscard]] std::uint32_t along_row(std::uint32_t row) const {
    std::uint32_t wide = row;
    for (int step = 1; step <= radius_; ++step) wide |= row << step | row >> step;
    return wide;
  }
  /// ORs rows that are up to `radius_` apart along one axis; `stride` apart in memory, as lines of the other axis are
  /// `line`.
  void spread_rows(int stride, int line) {
    const std::vector<std::uint32_t> before = rows_;
    for (int l = 0; l < side_; ++l) {
      for (int at = 0; at < side_; ++at) {
        std::uint32_t& row = rows_[std::size_t(l) * line + std::size_t(at) * stride];
        for (int other = std::max(0, at - radius_); other <= std::min(side_ - 1, at + radius_); ++other) {
          row |= before[std::size_t(l) * line + std::size_t(other) * stride];
        }
      }
    }
  }

  int radius_, side_;
  std::vector<std::uint32_t> rows_;  ///< [x][y], from `radius_` voxels before the brick on
};

std::vector<Voxel> missing_voxels(const PlaneWindow& window, Vec3i brick_min, int radius,
                                  const std::vector<Vec3i>& offsets) {
  const NearDensity near_density(window, brick_min, radius);
  std::vector<Voxel> added;
  std::optional<Voxel> outer;
  for (int offset = 0; offset < kBrickVoxels; ++offset) {
    const Vec3i local = brick_local(offset);
    const Vec3i at = brick_min + local;
    if (!near_density(local) || !window.is_missing(at)) continue;
    const auto source =
        std::find_if(offsets.begin(), offsets.end(), [&](Vec3i o) { return window.dense_at(at + o) != nullptr; });
    Voxel voxel = *window.dense_at(at + *source);
    if (dot(*source, *source) >= kBeyondInterpolation) {
      if (!outer) outer = voxel;
      voxel = *outer;
    }
    voxel.i = at.x;
    voxel.j = at.y;
    voxel.k = at.z;
    voxel.sigma = 0;
    added.push_back(voxel);
  }
  return added;
}

/// The middle plane of the window with what it lacks.
std::vector<Voxel> dilated_plane(const PlaneWindow& window, int radius, const std::vector<Vec3i>& offsets) {
  const VoxelBox reach = window.reach();
  std::vector<Vec3i> bricks;
  for (int y = 0; y < reach.size.y; y += kBrickSide) {
    for (int z = 0; z < reach.size.z; z += kBrickSide) {
      const Vec3i brick = reach.min + Vec3i{0, y, z};
      if (window.is_touched(brick)) bricks.push_back(brick);
    }
  }
  std::vector<std::vector<Voxel>> added(bricks.size());
  parallel_tasks(bricks.size(), [&](std::size_t b) { added[b] = missing_voxels(window, bricks[b], radius, offsets); });
  std::vector<Voxel> voxels = window.middle().voxels;
  for (const std::vector<Voxel>& brick : added) voxels.insert(voxels.end(), brick.begin(), brick.end());
  sort_voxels(voxels);
  return voxels;
}

}  // namespace

void sort_voxels(std::vector<Voxel>& voxels) {
  if (voxels.empty()) return;
  const VoxelBox box = bounding_box(voxels);
  std::vector<std::size_t> ends(std::size_t(box.size.x) + 1);  // of the voxels of each i
  for (const Voxel& voxel : voxels) ++ends[std::size_t(voxel.i - box.min.x) + 1];
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  std::vector<std::size_t> next(ends.begin(), ends.end() - 1);
  std::vector<Voxel> sorted(voxels.size());
  for (const Voxel& voxel : voxels) sorted[next[std::size_t(voxel.i - box.min.x)]++] = voxel;
  parallel_tasks(ends.size() - 1, [&](std::size_t i) {
    std::sort(sorted.begin() + std::ptrdiff_t(ends[i]), sorted.begin() + std::ptrdiff_t(ends[i + 1]),
              [](const Voxel& a, const Voxel& b) { return std::tie(a.j, a.k) < std::tie(b.j, b.k); });
  });
  voxels.swap(sorted);
}

VolumePlanes dilated(const VolumePlanes& volume, int radius) {
  CNERF_CHECK(radius >= 0 && radius <= kBrickSide, "dilation must be within [0, 8] voxels");
  VolumePlanes result = volume;
  if (volume.begin == volume.end) return result;
  --result.begin;
  ++result.end;
  if (!volume.statistics.dense.is_empty()) result.statistics.all.add(volume.statistics.dense.grown(radius));
  result.read = [window = PlaneWindow(volume), radius, offsets = offsets_by_distance(radius)](int plane) mutable {
    window.move_to(plane);
    return dilated_plane(window, radius, offsets);
  };
  return result;
}

void dilate_colors(Volume& volume, int radius) {
  sort_voxels(volume.voxels);
  volume = whole_volume(dilated(planes_of(volume), radius));
}

}  // namespace cnerf::bake
