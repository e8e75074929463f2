#include "bake/volume_baker.h"

#include <algorithm>

#include "bake/density_pass.h"
#include "bake/dilate.h"
#include "bake/radiance_pass.h"
#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

constexpr double kDensityShare = 0.4;

/// Maps the planes of a pass onto its part of the progress line, and stops on Ctrl-C.
class PassProgress {
 public:
  PassProgress(const ProgressSink& sink, double begin, double end, double planes)
      : sink_(sink), begin_(begin), share_((end - begin) / planes) {}

  void plane_done() {
    if (interruption_requested()) throw Interrupted("bake stopped: the same command goes on from here");
    ++done_;
    if (sink_) sink_({"bake", begin_ + share_ * done_, {}});
  }

 private:
  const ProgressSink& sink_;
  double begin_, share_;
  int done_ = 0;
};

int planes_of_all(const std::vector<BakeLevel>& levels) {
  int planes = 0;
  for (const BakeLevel& level : levels) planes += plane_count(level.plan);
  return planes;
}

}  // namespace

std::size_t planes_at_a_time(const BakeOptions& options) {
  constexpr int kThreadsOfPlane = 4, kMost = 4;
  if (!options.max_memory.empty()) return 1;
  return std::size_t(std::clamp(thread_count() / kThreadsOfPlane, 1, kMost));
}

// The journal's parts are the planes of the density pass, level by level, then those of the radiance pass.

std::vector<BakeLevel> bake_levels(const ColorField& field, const std::vector<BakePlan>& plans,
                                   const BakeOptions& options, BakeJournal& journal, const ProgressSink& sink) {
  std::vector<BakeLevel> levels;
  for (const BakePlan& plan : plans) levels.push_back({plan, empty_density(plan)});
  PassProgress progress(sink, 0, kDensityShare, planes_of_all(levels));
  std::size_t first = 0;
  bool any = false;
  for (BakeLevel& level : levels) {
    const auto planes = std::size_t(plane_count(level.plan));
    journal.parts<DenseVoxel>(
        first, planes, planes_at_a_time(options),
        [&](std::size_t plane) { return bake_density_plane(field, level.plan, options, int(plane)); },
        [&](std::size_t plane, const std::vector<DenseVoxel>& voxels) {
          put_plane(voxels, int(plane), level.sigma);
          any = any || !voxels.empty();
          progress.plane_done();
        });
    first += planes;
  }
  if (!any) throw InputError("bake: no voxel is as opaque as opacity_threshold; lower it, or check --aabb");
  return levels;
}

std::vector<VolumePlanes> bake_volumes(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                       const std::vector<BakeLevel>& levels, const BakeOptions& options,
                                       BakeJournal& journal, const ProgressSink& sink) {
  const auto planes_of_density = std::size_t(planes_of_all(levels));
  PassProgress progress(sink, kDensityShare, 1, double(planes_of_density));
  const auto views = select_views(cameras, density_levels(levels), options);
  std::vector<VolumePlanes> volumes;
  std::size_t dense_first = 0;
  for (std::size_t level = 0; level < levels.size(); ++level) {
    const BakePlan& plan = levels[level].plan;
    const RadiancePass pass(field, levels, level, *views, options);
    const auto planes = std::size_t(plane_count(plan));
    const std::size_t first = planes_of_density + dense_first;
    bool any = false;
    journal.parts<BakedVoxel>(
        first, planes, planes_at_a_time(options),
        [&](std::size_t plane) { return pass.bake_plane(journal.read<DenseVoxel>(dense_first + plane), int(plane)); },
        [&](std::size_t, const std::vector<BakedVoxel>& voxels) {
          any = any || !voxels.empty();
          progress.plane_done();
        });
    dense_first += planes;
    if (!any) continue;
    VolumePlanes volume{{plan.origin, plan.voxel_size, plan.resolution, field.frame(), {}, {}},
                        0,
                        plane_count(plan),
                        !options.max_memory.empty(),
                        {}};
    volume.read = [&journal, first, end = volume.end](int plane) {
      if (plane < 0 || plane >= end) return std::vector<BakedVoxel>();
      return journal.read<BakedVoxel>(first + std::size_t(plane));
    };
    volumes.push_back(std::move(volume));
  }
  if (volumes.empty()) {
    throw InputError("bake: no camera sees anything inside the box; check --aabb or use --keep-unseen");
  }
  return volumes;
}

BakedVolume bake_volume(const ColorField& field, const std::vector<BakeCamera>& cameras, const BakeOptions& options,
                        const ProgressSink& sink) {
  BakeJournal journal;
  const std::vector<BakeLevel> levels = bake_levels(field, {plan_bake(field, options)}, options, journal, sink);
  const std::vector<VolumePlanes> volumes = bake_volumes(field, cameras, levels, options, journal, sink);
  return whole_volume(dilated(volumes.front(), options.dilation));
}

}  // namespace cnerf
