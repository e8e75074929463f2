#include "bake/volume_baker.h"

#include "bake/bake_plan.h"
#include "bake/density_pass.h"
#include "bake/dilate.h"
#include "bake/radiance_pass.h"
#include "src/base/error.h"

namespace cnerf {
namespace {

/// Maps the shares of the passes onto one progress line, and stops on Ctrl-C.
class BakeProgress {
 public:
  explicit BakeProgress(const ProgressSink& sink) : sink_(sink) {}

  [[nodiscard]] std::function<void(double)> pass(double begin, double end) const {
    return [this, begin, end](double share) {
      if (interruption_requested()) throw Interrupted("bake stopped: nothing was written, run it again");
      if (sink_) sink_({"bake", begin + (end - begin) * share, {}});
    };
  }

 private:
  const ProgressSink& sink_;
};

bool any_dense(const DensityPass& density) {
  for (const std::vector<DenseVoxel>& brick : density.bricks) {
    if (!brick.empty()) return true;
  }
  return false;
}

}  // namespace

BakedVolume bake_volume(const ColorField& field, const std::vector<BakeCamera>& cameras, const BakeOptions& options,
                        const ProgressSink& sink) {
  constexpr double kDensityShare = 0.4, kRadianceShare = 0.95;
  const BakeProgress progress(sink);
  const BakePlan plan = plan_bake(field, options);

  const DensityPass density = bake_density(field, plan, options, progress.pass(0, kDensityShare));
  if (!any_dense(density)) {
    throw InputError("bake: no voxel is as opaque as opacity_threshold; lower it, or check --aabb");
  }
  BakedVolume volume;
  volume.origin = plan.origin;
  volume.voxel_size = plan.voxel_size;
  volume.resolution = plan.resolution;
  volume.frame = field.frame();
  volume.voxels = bake_radiance(field, cameras, plan, options, density, progress.pass(kDensityShare, kRadianceShare));
  if (volume.voxels.empty()) {
    throw InputError("bake: no camera sees anything inside the box; check --aabb or use --keep-unseen");
  }
  dilate_colors(volume, options.dilation);
  progress.pass(kRadianceShare, 1)(1);
  return volume;
}

}  // namespace cnerf
