#include "export/volume_export.h"

#include "export/blender_setup.h"
#include "export/manifest.h"

namespace cnerf {

VolumeExport export_volume(const BakedVolume& volume, const std::vector<BakeCamera>& cameras,
                           const std::vector<std::string>& command_line, const std::filesystem::path& folder,
                           const std::string& name, const VdbOptions& options) {
  VolumeExport written;
  written.vdb = folder / (name + ".vdb");
  write_vdb(volume, written.vdb, options);
  written.blender_setup = write_blender_setup(folder);

  BakeManifest manifest;
  manifest.command_line = command_line;
  manifest.files = {written.vdb.filename().string(), written.blender_setup.filename().string()};
  manifest.units = options.units;
  manifest.up_axis = options.up_axis;
  manifest.colorizer = volume.colorizer;
  manifest.take = volume.take;
  manifest.frame = volume.frame;
  manifest.cameras = cameras;
  manifest.volume = describe_volume(volume, written.vdb.filename().string(), options);
  written.manifest = write_manifest(manifest, folder);
  return written;
}

}  // namespace cnerf
