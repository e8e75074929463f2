#pragma once
/// A whole bake: plans, the check of memory, both passes over the volume, the mesh, and the journal by which a bake
/// that was stopped goes on.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "bake/camera.h"
#include "bake/mesh.h"
#include "bake/options.h"
#include "bake/out_of_core/planes.h"
#include "src/base/observer.h"
#include "src/cluster/ranks.h"
#include "src/engine/engines.h"
#include "src/field/color_field.h"

namespace cnerf::bake {

/// What happens to the volumes of a bake.
enum class VolumeUse {
  kNone,   ///< none are made
  kRead,   ///< they are read plane by plane
  kGrids,  ///< OpenVDB grids are made of them: `max_memory` counts these as well
};

struct Job {
  const ColorField& field;
  const Engines& engines;
  std::vector<Camera> cameras;  ///< of the capture
  Options options;
  cluster::Ranks& ranks = cluster::alone();  ///< that find voxels for each other; rank 0 alone goes on with them
  VolumeUse volumes = VolumeUse::kGrids;
  std::optional<MeshOptions> mesh = {};  ///< none: no mesh is made
  std::filesystem::path journal = {};    ///< the file of finished parts; there while the bake is not finished
  std::string identity = {};  ///< all that the voxels depend on beside what stands here: of which field they are
};

/// Takes what a job makes, once all of it is made: a job that is refused or stopped gives nothing.
class Output {
 public:
  virtual ~Output() = default;
  /// @param volumes  nested grids, finest first; colours are dilated.  They are gone when the job is.
  virtual void take_volumes(const std::vector<VolumePlanes>& volumes) = 0;
  virtual void take_mesh(const Mesh& mesh) = 0;
  /// Everything was taken. The journal goes after this.
  virtual void finish() = 0;
};

/// Runs a job, or goes on with one that was stopped.
/// @throws UsageError     on options that contradict each other, or less `max_memory` than the bake takes.
/// @throws InputError     when there is nothing to bake; the journal then goes.
/// @throws OutputError    when the journal cannot be written.
/// @throws ContractError  when the field answers NaN, infinity or a negative density.
/// @throws Interrupted    on Ctrl-C; and whatever `output` throws.
void run(const Job& job, Output& output, Observer& observer);

}  // namespace cnerf::bake
