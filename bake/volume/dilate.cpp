#include "bake/volume/dilate.h"

#include <openvdb/tools/Morphology.h>

#include <algorithm>
#include <array>
#include <memory>
#include <numeric>
#include <optional>
#include <tuple>

#include "bake/lattice/brick_grid.h"
#include "bake/volume/openvdb_grids.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

using openvdb::Coord;

// What the index says of a place: the index of a voxel with density, or one of these.
constexpr std::int32_t kMissing = -1;
constexpr std::int32_t kColorOnly = -2;

/// Squared distance from density, in voxels, at which trilinear interpolation no longer mixes in a voxel's colour.
constexpr int kBeyondInterpolation = 4;

/// The voxels of one plane of bricks, found by place. Bricks are the leaves of a VDB.
struct IndexedPlane {
  int plane = 0;
  std::vector<Voxel> voxels;
  openvdb::Int32Tree index{kMissing};  ///< active where density is
};

std::shared_ptr<const IndexedPlane> indexed(int plane, std::vector<Voxel> voxels) {
  auto indexed = std::make_shared<IndexedPlane>();
  indexed->plane = plane;
  indexed->voxels = std::move(voxels);
  openvdb::tree::ValueAccessor<openvdb::Int32Tree> index(indexed->index);
  for (std::size_t v = 0; v < indexed->voxels.size(); ++v) {
    const Voxel& voxel = indexed->voxels[v];
    const Coord at(voxel.i, voxel.j, voxel.k);
    CNERF_CHECK(index.getValue(at) == kMissing, "two baked voxels share a place");
    if (voxel.sigma > 0) {
      index.setValueOn(at, std::int32_t(v));
    } else {
      index.setValueOff(at, kColorOnly);
    }
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
      if (!next[n]) next[n] = indexed(plane + n - 1, source_.read(plane + n - 1));
    }
    planes_ = next;
  }
  [[nodiscard]] const IndexedPlane& middle() const { return *planes_[1]; }

  /// What is within `radius` voxels of density, along each axis.
  [[nodiscard]] openvdb::MaskTree near_density(int radius) const {
    openvdb::MaskTree near;
    for (const auto& plane : planes_) near.topologyUnion(plane->index);
    openvdb::tools::dilateActiveValues(near, radius, openvdb::tools::NN_FACE_EDGE_VERTEX, openvdb::tools::IGNORE_TILES);
    return near;
  }

  /// Looks voxels up; one for each thread.
  class Reader {
   public:
    explicit Reader(const PlaneWindow& window)
        : window_(window),
          index_{Index(window.planes_[0]->index), Index(window.planes_[1]->index), Index(window.planes_[2]->index)} {}
    [[nodiscard]] bool is_missing(const Coord& at) const { return index_[1].getValue(at) == kMissing; }
    /// The voxel there if it has density.
    [[nodiscard]] const Voxel* dense_at(const Coord& at) const {
      const int plane = (at.x() >> 3) - window_.planes_[0]->plane;
      const std::int32_t index = index_[plane].getValue(at);
      return index >= 0 ? &window_.planes_[plane]->voxels[index] : nullptr;
    }

   private:
    using Index = openvdb::tree::ValueAccessor<const openvdb::Int32Tree>;
    const PlaneWindow& window_;
    std::array<Index, 3> index_;
  };

 private:
  VolumePlanes source_;
  std::array<std::shared_ptr<const IndexedPlane>, 3> planes_;
};

int squared(const Coord& c) {
  return c.x() * c.x() + c.y() * c.y() + c.z() * c.z();
}

/// All offsets of the cube of this radius, nearest first.
std::vector<Coord> offsets_by_distance(int radius) {
  std::vector<Coord> offsets;
  for (const Coord offset : openvdb::CoordBBox(Coord(-radius), Coord(radius))) offsets.push_back(offset);
  std::stable_sort(offsets.begin(), offsets.end(),
                   [](const Coord& a, const Coord& b) { return squared(a) < squared(b); });
  return offsets;
}

/// What a brick lacks of the voxels near density.
std::vector<Voxel> missing_voxels(const PlaneWindow& window, const openvdb::MaskTree::LeafNodeType& near,
                                  const std::vector<Coord>& offsets) {
  const PlaneWindow::Reader reader(window);
  std::vector<Voxel> added;
  std::optional<Voxel> outer;
  for (auto it = near.cbeginValueOn(); it; ++it) {
    const Coord at = it.getCoord();
    if (!reader.is_missing(at)) continue;
    const auto source = std::find_if(offsets.begin(), offsets.end(),
                                     [&](const Coord& o) { return reader.dense_at(at + o) != nullptr; });
    Voxel voxel = *reader.dense_at(at + *source);
    if (squared(*source) >= kBeyondInterpolation) {
      if (!outer) outer = voxel;
      voxel = *outer;
    }
    voxel.i = at.x();
    voxel.j = at.y();
    voxel.k = at.z();
    voxel.sigma = 0;
    added.push_back(voxel);
  }
  return added;
}

/// The middle plane of the window with what it lacks.
std::vector<Voxel> dilated_plane(const PlaneWindow& window, int radius, const std::vector<Coord>& offsets) {
  const openvdb::MaskTree near = window.near_density(radius);
  std::vector<const openvdb::MaskTree::LeafNodeType*> bricks;
  for (auto leaf = near.cbeginLeaf(); leaf; ++leaf) {
    if (leaf->origin().x() == kBrickSide * window.middle().plane) bricks.push_back(&*leaf);
  }
  std::vector<std::vector<Voxel>> added(bricks.size());
  parallel_tasks(bricks.size(), [&](std::size_t b) { added[b] = missing_voxels(window, *bricks[b], offsets); });
  std::vector<Voxel> voxels = window.middle().voxels;
  for (const std::vector<Voxel>& brick : added) voxels.insert(voxels.end(), brick.begin(), brick.end());
  sort_voxels(voxels);
  return voxels;
}

}  // namespace

void sort_voxels(std::vector<Voxel>& voxels) {
  if (voxels.empty()) return;
  const VoxelBox box = bounding_box(voxels);
  std::vector<std::size_t> ends(std::size_t(box.size().x) + 1);  // of the voxels of each i
  for (const Voxel& voxel : voxels) ++ends[std::size_t(voxel.i - box.low.x) + 1];
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  std::vector<std::size_t> next(ends.begin(), ends.end() - 1);
  std::vector<Voxel> sorted(voxels.size());
  for (const Voxel& voxel : voxels) sorted[next[std::size_t(voxel.i - box.low.x)]++] = voxel;
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
