#pragma once
/// A whole volume bake on disk: the VDB, its manifest and the set-up script for Blender.

#include <filesystem>
#include <string>
#include <vector>

#include "bake/bake_camera.h"
#include "bake/baked_volume.h"
#include "export/vdb_writer.h"

namespace cnerf {

struct VolumeExport {
  std::filesystem::path vdb, manifest, blender_setup;
};

/// Writes `name`.vdb, manifest.json and blender_setup.py into `folder`, which is made if needed.
/// @throws ContractError, OutputError  as write_vdb.
VolumeExport export_volume(const BakedVolume& volume, const std::vector<BakeCamera>& cameras,
                           const std::vector<std::string>& command_line, const std::filesystem::path& folder,
                           const std::string& name, const VdbOptions& options = {});

}  // namespace cnerf
