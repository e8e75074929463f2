#include "bake/volume_baker.h"

#include "bake/dilate.h"
#include "bake/radiance_pass.h"
#include "src/base/error.h"

namespace cnerf {
namespace {

constexpr double kDensityShare = 0.4, kRadianceShare = 0.95;

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

}  // namespace

std::vector<BakeLevel> bake_levels(const ColorField& field, std::vector<BakePlan> plans, const BakeOptions& options,
                                   const ProgressSink& sink) {
  const BakeProgress progress(sink);
  return bake_levels(field, std::move(plans), options, progress.pass(0, kDensityShare));
}

std::vector<BakedVolume> bake_volumes(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                      const std::vector<BakeLevel>& levels, const BakeOptions& options,
                                      const ProgressSink& sink) {
  const BakeProgress progress(sink);
  std::vector<BakedVolume> volumes;
  const double share = (kRadianceShare - kDensityShare) / static_cast<double>(levels.size());
  for (std::size_t level = 0; level < levels.size(); ++level) {
    const double begin = kDensityShare + share * static_cast<double>(level);
    const BakePlan& plan = levels[level].plan;
    BakedVolume volume;
    volume.origin = plan.origin;
    volume.voxel_size = plan.voxel_size;
    volume.resolution = plan.resolution;
    volume.frame = field.frame();
    volume.voxels = bake_radiance(field, cameras, levels, level, options, progress.pass(begin, begin + share));
    if (volume.voxels.empty()) continue;
    dilate_colors(volume, options.dilation);
    volumes.push_back(std::move(volume));
  }
  if (volumes.empty()) {
    throw InputError("bake: no camera sees anything inside the box; check --aabb or use --keep-unseen");
  }
  progress.pass(kRadianceShare, 1)(1);
  return volumes;
}

BakedVolume bake_volume(const ColorField& field, const std::vector<BakeCamera>& cameras, const BakeOptions& options,
                        const ProgressSink& sink) {
  BakeOptions one = options;
  one.grids = "one";
  return std::move(
      bake_volumes(field, cameras, bake_levels(field, {plan_bake(field, one)}, one, sink), one, sink).front());
}

}  // namespace cnerf
