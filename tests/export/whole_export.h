#pragma once
/// A volume bake on disk in one call.

#include <filesystem>
#include <string>
#include <vector>

#include "export/bake_folder.h"
#include "tests/export/test_volumes.h"

namespace cnerf::exporting::test {

struct VolumeExport {
  std::filesystem::path vdb, manifest, blender_setup;
};

/// Writes `name`.vdb, manifest.json and blender_setup.py into `folder`, which is made if needed; colours reach two
/// voxels beyond density.
inline VolumeExport export_volume(const bake::Volume& volume, const std::vector<bake::Camera>& cameras,
                                  const std::filesystem::path& folder, const std::string& name,
                                  const VdbOptions& options = {}, const Label& label = label_of_first()) {
  BakeFolder bake(folder, cameras, label);
  const std::filesystem::path vdb = bake.add_volumes({dilated(planes_of(volume), 2)}, name, options).front();
  bake.finish();
  return {vdb, bake.manifest(), bake.blender_setup()};
}

}  // namespace cnerf::exporting::test
