#pragma once
/// A whole bake on disk: volume, mesh, textures, the manifest that names them and the set-up script for Blender.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "bake/mesh.h"
#include "bake/out_of_core/planes.h"
#include "export/gltf_writer.h"
#include "export/manifest.h"
#include "export/options.h"
#include "export/splat_writer.h"
#include "src/capture/picture_names.h"
#include "src/picture/sky_picture.h"

namespace cnerf::exporting {

/// Text of export/blender_setup.py, the Python script that shows a bake in Blender as it was trained.
[[nodiscard]] const std::string& blender_setup_text();
/// Writes it into the folder of a bake, beside its manifest.json, and returns its path. The script knows that folder,
/// so that it also works pasted into Blender's text editor.  @throws OutputError.
std::filesystem::path write_blender_setup(const std::filesystem::path& folder);

/// Takes one result after another, so that the caller need not hold them together. Files appear whole; the manifest,
/// by which others find them, comes last and lists exactly what this object wrote. A former one goes as soon as one of
/// its files may be replaced.
class BakeFolder {
 public:
  BakeFolder(std::filesystem::path folder, std::vector<bake::Camera> cameras, Label label);

  /// Nested grids, finest first: the coarsest as `name`.vdb, finer ones as `name`_fine1.vdb and so on; if asked for,
  /// the same as .nvdb, and a .usda that places them.
  /// @return  the files, coarsest first.  @throws ContractError, OutputError  as write_vdb.
  std::vector<std::filesystem::path> add_volumes(const std::vector<bake::VolumePlanes>& volumes,
                                                 const std::string& name, const VdbOptions& options);
  /// Writes `name`.gltf, .bin, .glb, `name`_basecolor.png and, if asked for, `name`_rgb.exr, _lum.exr and
  /// _lab.exr. To be called after add_volumes, where there is a volume: the mesh then names it.
  /// @throws ContractError, OutputError.
  GltfFiles add_mesh(const bake::Mesh& mesh, const std::string& name, bool exr);
  /// Writes `name`.ply, .spz and .usda.  @throws OutputError.
  SplatFiles add_splats(const bake::SplatCloud& cloud, const std::string& name);
  /// sky.exr, Blender's world, behind volume and mesh: it is written before the first of the other files. To be called
  /// before add_mesh, which names it.
  void add_sky(const SkyPicture& sky);
  /// A camera's photograph without lens distortion, in a folder `plates`: what Blender shows behind its view.
  /// @throws OutputError.
  void add_plate(const std::string& camera, const std::vector<std::byte>& jpeg);
  /// The cameras as cameras.usda, where the .usda of the volumes lies, and cameras.chan: see camera_tracks.h.
  /// @throws OutputError.
  void add_camera_tracks(const VdbOptions& options);
  /// Writes manifest.json, and blender_setup.py where there is a volume or a mesh to set up. Files that a former
  /// manifest here lists and this one does not are removed.  @throws OutputError.
  void finish();

  [[nodiscard]] std::filesystem::path manifest() const { return folder_ / "manifest.json"; }
  [[nodiscard]] std::filesystem::path blender_setup() const { return folder_ / "blender_setup.py"; }

 private:
  ManifestVolume write_grids(const bake::VolumePlanes& volume, const std::string& name, const VdbOptions& options);
  void begin();
  void write_sky() const;
  [[nodiscard]] std::filesystem::path former_manifest() const { return folder_ / ".former-manifest.json"; }
  void list(const std::filesystem::path& file) { manifest_.files.push_back(file.filename().string()); }

  std::filesystem::path folder_;
  BakeManifest manifest_;
  PictureNames plate_names_;
  std::optional<SkyPicture> sky_;
  bool has_begun_ = false;
};

}  // namespace cnerf::exporting
