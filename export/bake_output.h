#pragma once
/// A bake job's results as the files of a folder: volumes, mesh and textures, web bundle, and what names them.

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bake/job/job.h"
#include "bake/splat/splat.h"
#include "export/bake_folder.h"
#include "export/options.h"
#include "src/base/observer.h"
#include "src/capture/capture.h"

namespace cnerf::exporting {

struct WebVolume;

/// What a bake writes.
struct Formats {
  bool vdb = false;    ///< the volume
  bool gltf = false;   ///< a textured mesh, as .gltf and .glb
  bool exr = false;    ///< the mesh's textures in floating point, beside the mesh
  bool web = false;    ///< a folder with a page, for browsers
  bool splat = false;  ///< 3-D Gaussians as PLY, SPZ and USD

  [[nodiscard]] bool has_manifest() const { return is_for_blender() || splat; }
  /// Whether there is what the set-up script shows.
  [[nodiscard]] bool is_for_blender() const { return vdb || gltf; }
  [[nodiscard]] Formats operator|(const Formats& other) const {
    return {vdb || other.vdb, gltf || other.gltf, exr || other.exr, web || other.web, splat || other.splat};
  }
  bool operator==(const Formats&) const = default;
  [[nodiscard]] bool has_only_splats() const { return splat && !vdb && !gltf && !web; }
  [[nodiscard]] bake::VolumeUse volumes() const {
    return vdb ? bake::VolumeUse::kGrids : web ? bake::VolumeUse::kRead : bake::VolumeUse::kNone;
  }
};
/// "vdb,gltf,exr,web,splat" or some of them; exr brings the mesh along.  @throws UsageError.
[[nodiscard]] Formats parse_formats(const std::string& list);

/// The file that a bake of these formats writes last: once it is there, all of it is.
[[nodiscard]] std::filesystem::path last_file(const std::filesystem::path& folder, const Formats& formats);
/// What a folder has of a bake that ended; nothing where none did.  @throws InputError  as read_manifest
[[nodiscard]] Formats formats_in(const std::filesystem::path& folder);
/// The folder of the web bundle of a bake.
[[nodiscard]] std::filesystem::path web_folder(const std::filesystem::path& bake);

/// How files are written.
struct OutputOptions {
  VdbOptions vdb;
  WebOptions web;
  std::filesystem::path page;          ///< folder of the built page of web bundles; empty = none
  std::optional<SkyPicture> sky = {};  ///< behind what is baked
};

class BakeOutput final : public bake::Output {
 public:
  /// @param capture   whose cameras and photographs stand beside the results; must outlive this object, as `observer`
  BakeOutput(std::filesystem::path folder, const Formats& formats, OutputOptions options, const Capture& capture,
             const Label& label, Observer& observer);

  void take_volumes(const std::vector<bake::VolumePlanes>& volumes) override;
  void take_mesh(const bake::Mesh& mesh) override;
  /// @param fit  is called before the first file is written, so that a stop meanwhile replaces nothing; its memory
  /// comes
  ///             on top of the volumes'
  void take_splats(std::function<bake::SplatCloud()> fit) { fit_ = std::move(fit); }
  void finish() override;

 private:
  void write_bundle(const WebVolume& volume) const;
  void add_plates();
  void fit_splats();
  void add_splats();

  std::filesystem::path folder_;
  Formats formats_;
  OutputOptions options_;
  const Capture& capture_;
  Label label_;
  BakeFolder bake_;
  std::function<bake::SplatCloud()> fit_;  // of splats
  std::optional<bake::SplatCloud> splats_;
  Observer& observer_;
};

}  // namespace cnerf::exporting
