#include "export/volume_export.h"

#include "export/bake_folder.h"

namespace cnerf {

VolumeExport export_volume(const BakedVolume& volume, const std::vector<BakeCamera>& cameras,
                           const std::vector<std::string>& command_line, const std::filesystem::path& folder,
                           const std::string& name, const VdbOptions& options) {
  BakeFolder bake(folder, cameras, command_line, options.units, options.up_axis);
  const std::filesystem::path vdb = bake.add_volume(volume, name, options);
  bake.finish();
  return {vdb, bake.manifest(), bake.blender_setup()};
}

}  // namespace cnerf
