#pragma once
/// manifest.json: what a bake consists of and where it lies. Everything else that reads a bake starts here.

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "bake/camera.h"
#include "bake/mesh.h"
#include "bake/splat/splat.h"
#include "bake/volume.h"
#include "export/vdb_writer.h"
#include "src/base/aabb.h"

namespace cnerf::exporting {

inline constexpr int kManifestSchema = 1;

/// The volume of a bake, for programs that set up a scene without reading it.
struct ManifestVolume {
  std::string file;          ///< relative to the manifest
  Aabbd bounds;              ///< world units; around voxels with density
  double voxel_size = 0;     ///< world units
  Vec3i resolution{};        ///< voxels along each axis of the baked box
  std::size_t voxels = 0;    ///< with density
  double max_density = 0;    ///< 1/world unit
  std::string voxel_origin;  ///< "center" or "corner", see VdbOptions
  bool half_density = true;  ///< density is stored in 16 bits
  double density_scale = 1;  ///< what the file's density is to be multiplied with; earlier versions could normalize it
  Affined file_from_world;   ///< a rotation, see VdbOptions::up

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v);
};
[[nodiscard]] ManifestVolume describe_volume(const bake::VolumePlanes& volume, const std::string& file,
                                             const VdbOptions& options, const WorldConvention& world);

/// The mesh of a bake. File names are relative to the manifest; empty = not written.
struct ManifestMesh {
  std::string gltf, glb, basecolor;  ///< basecolor: sRGB PNG of the .gltf
  std::string rgb_exr, luminance_exr, lab_exr;
  Aabbd bounds;  ///< world units
  std::size_t vertices = 0, faces = 0;
  int texture_size = 0, gutter = 0, charts = 0;
  double voxel_size = 0;    ///< world units; of the density it was cut from
  Affined gltf_from_world;  ///< turned and scaled: glTF is Y-up and in metres

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v);
};
/// All but the names of files and `gltf_from_world`.
[[nodiscard]] ManifestMesh describe_mesh(const bake::Mesh& mesh);

/// The light from beyond the volume.
struct ManifestSky {
  std::string file;  ///< relative to the manifest: linear Rec.709, half float

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v);
};

/// The splats of a bake, three times the same. File names are relative to the manifest.
struct ManifestSplats {
  std::string ply, spz, usd;
  Aabbd bounds;  ///< world units; of the centres
  std::size_t count = 0;
  int degree = 0;  ///< of the harmonics

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v);
};
/// All but the names of files.
[[nodiscard]] ManifestSplats describe_splats(const bake::SplatCloud& cloud);

struct BakeManifest {
  Label label;
  /// What a file was when the manifest was written.
  struct FileState {
    std::uintmax_t bytes = 0;
    std::string sha256;
  };
  std::map<std::string, FileState> states;  ///< of files, once it is read; earlier versions wrote none
  std::vector<std::string> files;  ///< relative to the manifest; their sizes and SHA-256 are added when writing
  SceneFrame frame;
  std::vector<bake::Camera> cameras;          ///< of the capture
  std::map<std::string, std::string> plates;  ///< camera's name -> its photograph without lens distortion, a file
  std::optional<ManifestVolume> volume;       ///< the only grid, or the coarsest of nested ones
  std::vector<ManifestVolume> finer_volumes;  ///< inside of it, finest first; each coarser one is empty there
  std::optional<ManifestMesh> mesh;
  std::optional<ManifestSky> sky;  ///< where the capture has one
  std::optional<ManifestSplats> splats;
};

/// Writes `manifest.json` into `folder`, where the listed files already are, and returns its path.
/// @throws MissingInputError  when a listed file is not there.  @throws OutputError.
std::filesystem::path write_manifest(const BakeManifest& manifest, const std::filesystem::path& folder);

/// Reads it back.
/// @throws MissingInputError, InputError  naming the field; also for a newer schema, and cameras that nothing can be
///                                        rendered for.
[[nodiscard]] BakeManifest read_manifest(const std::filesystem::path& file);

/// The parts that the manifest of a web bundle repeats word by word.
[[nodiscard]] nlohmann::ordered_json camera_json(const bake::Camera& camera);
[[nodiscard]] nlohmann::ordered_json frame_json(const SceneFrame& frame);
[[nodiscard]] nlohmann::ordered_json color_json(const bake::Provenance& provenance);

/// A file of a bake, before it is opened.
/// @throws InputError  unless the manifest lists it, as it is now, and it lies in the folder.  @throws
/// MissingInputError.
void check_listed_file(const BakeManifest& manifest, const std::filesystem::path& folder, const std::string& name);

/// The file that a name means below a folder; nothing where the name leads out of it, through links too, or means no
/// file.
[[nodiscard]] std::optional<std::filesystem::path> file_below(const std::filesystem::path& folder,
                                                              const std::string& name);

}  // namespace cnerf::exporting
