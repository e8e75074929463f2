#include "bake/volume_baker.h"

#include "bake/density_pass.h"
#include "bake/dilate.h"
#include "bake/radiance_pass.h"
#include "src/base/error.h"

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

// The journal's parts are the planes of the density pass, level by level, then those of the radiance pass.

std::vector<BakeLevel> bake_levels(const ColorField& field, const std::vector<BakePlan>& plans,
                                   const BakeOptions& options, BakeJournal& journal, const ProgressSink& sink) {
  std::vector<BakeLevel> levels;
  for (const BakePlan& plan : plans) levels.push_back({plan, empty_density(plan)});
  PassProgress progress(sink, 0, kDensityShare, planes_of_all(levels));
  std::size_t part = 0;
  bool any = false;
  for (BakeLevel& level : levels) {
    for (int plane = 0; plane < plane_count(level.plan); ++plane) {
      const auto voxels =
          journal.part<DenseVoxel>(part++, [&] { return bake_density_plane(field, level.plan, options, plane); });
      put_plane(voxels, plane, level.sigma);
      any = any || !voxels.empty();
      progress.plane_done();
    }
  }
  if (!any) throw InputError("bake: no voxel is as opaque as opacity_threshold; lower it, or check --aabb");
  return levels;
}

std::vector<VolumePlanes> bake_volumes(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                       const std::vector<BakeLevel>& levels, const BakeOptions& options,
                                       BakeJournal& journal, const ProgressSink& sink) {
  const auto planes_of_density = static_cast<std::size_t>(planes_of_all(levels));
  PassProgress progress(sink, kDensityShare, 1, static_cast<double>(planes_of_density));
  const auto views = select_views(cameras, density_levels(levels), options);
  std::vector<VolumePlanes> volumes;
  std::size_t dense_part = 0;
  for (std::size_t level = 0; level < levels.size(); ++level) {
    const BakePlan& plan = levels[level].plan;
    const RadiancePass pass(field, levels, level, *views, options);
    const std::size_t first = planes_of_density + dense_part;
    bool any = false;
    for (int plane = 0; plane < plane_count(plan); ++plane, ++dense_part) {
      const auto voxels = journal.part<BakedVoxel>(
          planes_of_density + dense_part, [&] { return pass.bake_plane(journal.read<DenseVoxel>(dense_part), plane); });
      any = any || !voxels.empty();
      progress.plane_done();
    }
    if (!any) continue;
    VolumePlanes volume{{plan.origin, plan.voxel_size, plan.resolution, field.frame(), {}, {}},
                        0,
                        plane_count(plan),
                        !options.max_memory.empty(),
                        {}};
    volume.read = [&journal, first, end = volume.end](int plane) {
      if (plane < 0 || plane >= end) return std::vector<BakedVoxel>();
      return journal.read<BakedVoxel>(first + static_cast<std::size_t>(plane));
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
