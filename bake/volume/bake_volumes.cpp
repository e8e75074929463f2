#include "bake/volume/bake_volumes.h"

#include <algorithm>

#include "bake/density/density_pass.h"
#include "bake/progress.h"
#include "bake/volume/radiance_pass.h"
#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
std::vector<VolumePlanes> bake_volumes(const ColorField& field, const ViewSelection& views,
                                       const std::vector<Level>& levels, const Options& options, Journal& journal,
                                       const ProgressSink& sink) {
  const std::size_t planes_of_density = plane_count(levels);
  const PassProgress progress = volume_progress(sink, kDensityPassShare, 1);
  std::size_t done = 0;
  std::vector<VolumePlanes> volumes;
  std::size_t dense_first = 0;
  for (std::size_t level = 0; level < levels.size(); ++level) {
    const Plan& plan = levels[level].plan;
    const RadiancePass pass(field, levels, level, views, options);
    const auto planes = std::size_t(plane_count(plan));
    const std::size_t first = planes_of_density + dense_first;
    VolumePlanes volume;
    static_cast<VolumeHeader&>(volume) = {plan.origin, plan.voxel_size, plan.resolution, field.frame()};
    volume.end = int(planes);
    volume.is_sparing = !options.max_memory.empty();
    journal.parts<Voxel>(
        first, planes, planes_at_a_time(options),
        [&](std::size_t plane) { return pass.bake_plane(journal.read<DenseVoxel>(dense_first + plane), int(plane)); },
        [&](std::size_t, const std::vector<Voxel>& voxels) {
          volume.statistics.add(voxels);
          progress.report(double(++done) / double(planes_of_density));
        });
    dense_first += planes;
    if (volume.statistics.all.is_empty()) continue;
    volume.read = [&journal, first, end = volume.end](int plane) {
      if (plane < 0 || plane >= end) return std::vector<Voxel>();
      return journal.read<Voxel>(first + std::size_t(plane));
    };
    volumes.push_back(std::move(volume));
  }
  if (volumes.empty()) {
    throw InputError("bake: no camera sees anything inside the box; check --aabb or use --keep-unseen");
  }
  return volumes;
}

}  // namespace cnerf::bake
