#include "export/web_levels.h"

#include <algorithm>
#include <cmath>

#include "bake/lattice/brick_grid.h"
#include "bake/out_of_core/planes.h"
#include "bake/volume/dilate.h"
#include "bake/volume/resample.h"
#include "src/base/check.h"
#include "src/color/colorspace_math.h"

namespace cnerf::exporting {
namespace {

using bake::Volume;
using bake::Voxel;
using bake::VoxelBox;

void keep_dense(Volume& volume) {
  std::erase_if(volume.voxels, [](const Voxel& voxel) { return !(voxel.sigma > 0); });
}

bool is_inside(const VoxelBox& box, Vec3i v) {
  for (int axis = 0; axis < 3; ++axis) {
    if (v[axis] < box.low[axis] || v[axis] >= box.high[axis]) return false;
  }
  return true;
}

Aabbd world_box(const Volume& volume, const VoxelBox& box) {
  return {volume.origin + box.low.cast<double>() * volume.voxel_size,
          volume.origin + box.high.cast<double>() * volume.voxel_size};
}

/// The voxels of the coarser volume that the finer one answers for: those it lies in, and one more at every side where
/// nothing is, so that its rims end within. Where it is cut off, the coarser one goes on.
VoxelBox cover_of(const Volume& finer, const Volume& coarser) {
  VoxelBox cover = voxels_of(coarser, world_box(finer, bounding_box(finer.voxels)));
  for (int side = 0; side < 6; ++side) {
    VoxelBox layer = cover;
    const int axis = side / 2;
    if (side % 2 == 0) {
      layer.high[axis] = cover.low[axis];
      layer.low[axis] = cover.low[axis] - 1;
    } else {
      layer.low[axis] = cover.high[axis];
      layer.high[axis] = cover.high[axis] + 1;
    }
    const auto is_in_layer = [&](const Voxel& v) { return is_inside(layer, {v.i, v.j, v.k}); };
    if (std::ranges::none_of(coarser.voxels, is_in_layer)) cover.add(layer);
  }
  return cover;
}

/// Values between the voxels of a volume, each of which has density.
class Interpolated {
 public:
  explicit Interpolated(const Volume& volume) : volume_(volume), numbers_(numbered(volume)) {}

  /// Density interpolates by itself, colour weighs by density.  @return a voxel with sigma 0 where nothing is.
  [[nodiscard]] Voxel at(Vec3d world) const {
    const Vec3d p = (world - volume_.origin) / volume_.voxel_size - Vec3d{0.5, 0.5, 0.5};
    const Vec3i base{int(std::floor(p.x)), int(std::floor(p.y)), int(std::floor(p.z))};
    const Vec3d t = p - base.cast<double>();
    double sigma = 0, luminance = 0;
    Vec3d rgb{};
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3i step{corner & 1, corner >> 1 & 1, corner >> 2};
      const std::int32_t number = numbers_.at(base + step);
      if (number < 0) continue;
      const Voxel& voxel = volume_.voxels[std::size_t(number)];
      double weight = voxel.sigma;
      for (int axis = 0; axis < 3; ++axis) weight *= step[axis] ? t[axis] : 1 - t[axis];
      sigma += weight;
      luminance += weight * voxel.luminance;
      rgb += voxel.rgb.cast<double>() * weight;
    }
    if (!(sigma > 0)) return {};
    const Vec3f color = (rgb / sigma).cast<float>();
    const Lab<float> lab = lab_from_linear_rgb(color);
    return {0, 0, 0, float(sigma), float(luminance / sigma), color, lab.a, lab.b};
  }

 private:
  static bake::BrickGrid<std::int32_t> numbered(const Volume& volume) {
    const VoxelBox box = bounding_box(volume.voxels);
    bake::BrickGrid<std::int32_t> numbers(box.low, box.size(), -1);
    for (std::size_t v = 0; v < volume.voxels.size(); ++v) {
      const Voxel& voxel = volume.voxels[v];
      numbers.set({voxel.i, voxel.j, voxel.k}, std::int32_t(v));
    }
    return numbers;
  }

  const Volume& volume_;
  bake::BrickGrid<std::int32_t> numbers_;
};

/// Adds voxels around a box of a volume, with what another one holds there.
void add_layers(Volume& volume, const VoxelBox& box, int layers, const Volume& around) {
  const Interpolated values(around);
  const VoxelBox grown = box.grown(layers);
  for (int i = grown.low.x; i < grown.high.x; ++i) {
    for (int j = grown.low.y; j < grown.high.y; ++j) {
      for (int k = grown.low.z; k < grown.high.z; ++k) {
        if (is_inside(box, {i, j, k})) {
          k = box.high.z - 1;  // on to what lies behind
          continue;
        }
        Voxel voxel = values.at(volume.origin + Vec3d{i + 0.5, j + 0.5, k + 0.5} * volume.voxel_size);
        if (!(voxel.sigma > 0)) continue;
        voxel.i = i;
        voxel.j = j;
        voxel.k = k;
        volume.voxels.push_back(voxel);
      }
    }
  }
}

/// Voxels around its cover that a volume needs where `resolution` of them along its longest axis are kept.
int layers_for(const Volume& volume, int resolution) {
  const int longest = std::max({volume.resolution.x, volume.resolution.y, volume.resolution.z});
  // A voxel made larger may begin anywhere: it has to be full, and so has the one beside it.
  return longest <= resolution ? 1 : int(std::ceil(2.0 * longest / resolution));
}

}  // namespace

std::vector<WebBricks> make_web_levels(std::vector<Volume> volumes, int resolution) {
  for (Volume& volume : volumes) keep_dense(volume);
  std::erase_if(volumes, [](const Volume& volume) { return volume.voxels.empty(); });
  CNERF_CHECK(!volumes.empty(), "no voxel has density");
  std::vector<WebBricks> levels;
  Volume whole = std::move(volumes.front());  // with all that is finer
  for (std::size_t next = 1; next < volumes.size(); ++next) {
    Volume finer = std::move(whole);
    const Aabbd cover = world_box(volumes[next], cover_of(finer, volumes[next]));
    std::vector<Volume> both;
    both.push_back(finer);
    both.push_back(std::move(volumes[next]));
    whole = merged_volume(std::move(both));
    add_layers(finer, voxels_of(finer, cover), layers_for(finer, resolution), whole);
    levels.push_back(make_web_bricks(resample_volume(finer, resolution), cover));
  }
  levels.push_back(make_web_bricks(resample_volume(whole, resolution)));
  std::ranges::reverse(levels);
  return levels;
}

}  // namespace cnerf::exporting
