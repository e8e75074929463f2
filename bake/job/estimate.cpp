#include "bake/job/estimate.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "bake/density/density_pass.h"
#include "bake/lattice/brick_grid.h"
#include "bake/visibility/view_selection.h"
#include "bake/volume.h"
#include "bake/volume/bake_volumes.h"
#include "src/base/byte_count.h"
#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

constexpr std::size_t kProbes = 8192;   ///< bricks of a grid that are looked into
constexpr double kBytesInHalf = 7 * 2;  ///< of a voxel: density, colour, a, b, luminance

struct Contents {
  double voxels = 0, bricks = 0;
  double in_fullest_plane = 0;  ///< voxels

  void add_plane(double plane_voxels, double plane_bricks) {
    voxels += plane_voxels;
    bricks += plane_bricks;
    in_fullest_plane = std::max(in_fullest_plane, plane_voxels);
  }
};

/// What is found in some bricks of a grid, blown up to all of them.
Contents probe(const ColorField& field, const Plan& plan, const Options& options) {
  const Vec3i counts = plane_bricks(plan);
  const std::size_t in_plane = std::size_t(counts.y) * counts.z;
  const std::size_t all = in_plane * std::size_t(plane_count(plan));
  // Odd, so that it meets all columns of a plane whose rows are a power of two long.
  const std::size_t stride = std::max<std::size_t>(1, all / kProbes) | 1;
  Contents contents;
  for (int plane = 0; plane < plane_count(plan); ++plane) {
    const std::size_t begin = in_plane * std::size_t(plane);
    std::vector<std::uint32_t> bricks;
    for (std::size_t b = (stride - begin % stride) % stride; b < in_plane; b += stride) {
      bricks.push_back(std::uint32_t(b));
    }
    const std::vector<DenseVoxel> voxels = bake_density_bricks(field, plan, options, plane, bricks);
    double filled = 0;
    for (std::size_t v = 0; v < voxels.size(); ++v) filled += v == 0 || voxels[v].brick != voxels[v - 1].brick ? 1 : 0;
    contents.add_plane(double(voxels.size() * stride), filled * double(stride));
  }
  return contents;
}

/// Of all voxels of a volume.
Contents contents_of(const VolumePlanes& volume) {
  Contents contents;
  for (int plane = volume.begin; plane < volume.end; ++plane) {
    const std::vector<Voxel> voxels = volume.read(plane);
    std::set<std::pair<int, int>> bricks;
    for (const Voxel& voxel : voxels) {
      const Vec3i brick = brick_part({voxel.i, voxel.j, voxel.k});
      bricks.emplace(brick.y, brick.z);
    }
    contents.add_plane(double(voxels.size()), double(bricks.size()));
  }
  return contents;
}

/// Memory that writing a grid of `planes` planes of bricks takes.
double writing_bytes(const Contents& contents, int planes, bool is_sparing) {
  // Of the grids of a file: of the largest, that of colours, where they are written one after another.
  const double leaf_bytes = (is_sparing ? 3 : 7) * kBrickVoxels * sizeof(float);
  constexpr double kRim = 1.5;   // leaves that only hold dilated colours
  constexpr double kPlanes = 4;  // three to look into, one made and sorted
  const double compressed = is_sparing ? 0 : contents.voxels * kBytesInHalf;
  return contents.bricks * kRim * leaf_bytes + compressed +
         double(part_count(planes, is_sparing)) * kPlanes * contents.in_fullest_plane * kRim * sizeof(Voxel);
}

/// `options.max_memory` in bytes.
std::size_t allowed_bytes(const Options& options) {
  return bytes_from("max_memory", options.max_memory);
}

}  // namespace

Estimate estimate_bake(const ColorField& field, const std::vector<Plan>& plans, const Options& options) {
  Options coarse = options;
  coarse.subsamples = 1;                                        // counts, not values
  constexpr double kBrickBytes = kBrickVoxels * sizeof(float);  // of the density that light passes through
  constexpr double kSampleBytes = 40;                           // of a density sample on its way
  constexpr double kSightBytes = 200, kSeenBytes = 68;          // of a voxel in a question who sees it, and of a view
  double finding = thread_count() * double(field.points_at_a_time()) * kSampleBytes, writing = 0;
  Estimate estimate;
  for (const Plan& plan : plans) {
    const Contents contents = probe(field, plan, coarse);
    const auto bricks = double(plan.lattice_voxels()) / kBrickVoxels;
    finding += contents.bricks * kBrickBytes + bricks * sizeof(void*);
    const double asked =
        std::min(contents.in_fullest_plane, double(kViewsAtATime) / options.views_per_voxel + kBrickVoxels);
    finding +=
        double(planes_at_a_time(options)) * (contents.in_fullest_plane * (sizeof(DenseVoxel) + 2 * sizeof(Voxel)) +
                                             asked * (kSightBytes + kSeenBytes * options.views_per_voxel));
    writing = std::max(writing, writing_bytes(contents, plane_count(plan), !options.max_memory.empty()));
    estimate.voxels += std::size_t(contents.voxels);
  }
  estimate.memory_bytes = std::size_t(finding);
  estimate.writing_bytes = std::size_t(writing);
  estimate.disk_bytes = estimate.voxels * (sizeof(DenseVoxel) + sizeof(Voxel));
  estimate.file_bytes = std::size_t(double(estimate.voxels) * kBytesInHalf);
  return estimate;
}

void check_memory(const Estimate& estimate, std::size_t held_bytes, const Options& options) {
  if (options.max_memory.empty()) return;
  const std::size_t needed = estimate.memory_bytes + held_bytes;
  if (needed <= allowed_bytes(options)) return;
  throw UsageError("max_memory: " + options.max_memory +
                   " is too little, finding the voxels of this bake takes about " + in_words(needed) +
                   "; lower --resolution, cut the box with --aabb or raise bake.opacity_threshold");
}

void check_writing_memory(const std::vector<VolumePlanes>& volumes, std::size_t held_bytes, const Options& options) {
  if (options.max_memory.empty()) return;
  double writing = 0;
  for (const VolumePlanes& volume : volumes) {
    writing = std::max(writing, writing_bytes(contents_of(volume), volume.end - volume.begin, volume.is_sparing));
  }
  const std::size_t needed = std::size_t(writing) + held_bytes;
  if (needed <= allowed_bytes(options)) return;
  throw UsageError("max_memory: " + options.max_memory + " is too little, writing the files of this bake takes about " +
                   in_words(needed) + "; its voxels are kept: give the same command more memory");
}

}  // namespace cnerf::bake
