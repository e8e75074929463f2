#pragma once
/// A whole bake on disk: volume, mesh, textures, the manifest that names them and the set-up script for Blender.

#include <filesystem>
#include <string>
#include <vector>

#include "bake/baked_mesh.h"
#include "export/exr_writer.h"
#include "export/gltf_writer.h"
#include "export/manifest.h"
#include "export/texture_writer.h"
#include "export/vdb_writer.h"

namespace cnerf {

struct MeshExportOptions {
  bool exr = true;  ///< also the float textures
  ExrOptions textures;
};

/// Takes one result after another, so that the caller need not hold them together. Files appear whole; the manifest,
/// by which others find them, comes last and lists exactly what this object wrote.
class BakeFolder {
 public:
  /// @param command_line  recorded.  @param units, up_axis  of the world, as in VdbOptions.
  BakeFolder(std::filesystem::path folder, std::vector<BakeCamera> cameras, std::vector<std::string> command_line,
             const std::string& units, const std::string& up_axis);

  /// Writes `name`.vdb and, if asked for, `name`.nvdb.  @throws ContractError, OutputError  as write_vdb.
  std::filesystem::path add_volume(const VolumePlanes& volume, const std::string& name, const VdbOptions& options);
  std::filesystem::path add_volume(const BakedVolume& volume, const std::string& name, const VdbOptions& options);
  /// Nested grids, finest first: the coarsest as `name`.vdb, finer ones as `name`_fine1.vdb and so on.
  /// @return  the files, coarsest first.
  std::vector<std::filesystem::path> add_volumes(const std::vector<VolumePlanes>& volumes, const std::string& name,
                                                 const VdbOptions& options);
  /// Writes `name`.gltf, .bin, .glb, `name`_basecolor.png and, if asked for, `name`_rgb.exr, _lum.exr and _lab.exr.
  /// To be called after add_volume, where there is a volume: the mesh then names it.
  /// @throws ContractError, OutputError.
  GltfFiles add_mesh(const BakedMesh& mesh, const std::string& name, const MeshExportOptions& options);
  /// A camera's photograph without lens distortion, as plates/`stem`.jpg: what Blender shows behind its view.
  /// @throws OutputError.
  void add_plate(const std::string& camera, const std::vector<std::byte>& jpeg);
  /// Writes blender_setup.py and manifest.json. Files that a former manifest here lists and this one does not are
  /// removed.  @throws OutputError.
  void finish();

  [[nodiscard]] std::filesystem::path manifest() const { return folder_ / "manifest.json"; }
  [[nodiscard]] std::filesystem::path blender_setup() const { return folder_ / "blender_setup.py"; }

 private:
  std::filesystem::path write_grids(const VolumePlanes& volume, const std::string& name, const VdbOptions& options);
  void list(const std::filesystem::path& file) { manifest_.files.push_back(file.filename().string()); }

  std::filesystem::path folder_;
  BakeManifest manifest_;
};

}  // namespace cnerf
