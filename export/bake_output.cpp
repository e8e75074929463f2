#include "export/bake_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <span>
#include <sstream>
#include <utility>

#include "export/web_bundle.h"
#include "src/base/absolute_folder.h"
#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf::exporting {
namespace fs = std::filesystem;

Formats parse_formats(const std::string& list) {
  Formats formats;
  std::istringstream words(list);
  for (std::string format; std::getline(words, format, ',');) {
    bool* flag = format == "vdb"     ? &formats.vdb
                 : format == "gltf"  ? &formats.gltf
                 : format == "exr"   ? &formats.exr
                 : format == "web"   ? &formats.web
                 : format == "splat" ? &formats.splat
                                     : nullptr;
    if (flag == nullptr) throw UsageError("--format: expected vdb, gltf, exr, web or splat, got '" + format + "'");
    *flag = true;
  }
  if (!formats.vdb && !formats.gltf && !formats.exr && !formats.web && !formats.splat) {
    throw UsageError("--format: expected vdb, gltf, exr, web or splat, got none");
  }
  formats.gltf = formats.gltf || formats.exr;
  return formats;
}

fs::path web_folder(const fs::path& bake) {
  return bake / "web";
}

fs::path last_file(const fs::path& folder, const Formats& formats) {
  return formats.has_manifest() ? folder / "manifest.json" : web_folder(folder) / kWebManifest;
}

Formats formats_in(const fs::path& folder) {
  Formats made;
  made.web = fs::exists(last_file(folder, {.web = true}));
  const fs::path file = last_file(folder, {.vdb = true});
  if (!fs::exists(file)) return made;
  const BakeManifest manifest = read_manifest(file);
  made.vdb = manifest.volume.has_value();
  made.gltf = manifest.mesh.has_value();
  made.exr = made.gltf && !manifest.mesh->rgb_exr.empty();
  made.splat = manifest.splats.has_value();
  return made;
}

BakeOutput::BakeOutput(fs::path folder, const Formats& formats, OutputOptions options, const Capture& capture,
                       const Label& label, Observer& observer)
    : folder_(std::move(folder)),
      formats_(formats),
      options_(std::move(options)),
      capture_(capture),
      label_(label),
      bake_(folder_, bake::cameras_of(capture), label),
      observer_(observer) {
  if (options_.sky && formats_.has_manifest()) bake_.add_sky(*options_.sky);
}

void BakeOutput::take_volumes(const std::vector<bake::VolumePlanes>& volumes) {
  std::optional<WebVolume> bundle;
  if (formats_.web) {  // may be refused: before a file is replaced
    std::vector<bake::Volume> whole;
    for (const bake::VolumePlanes& volume : volumes) whole.push_back(whole_volume(volume));
    bundle = make_web_volume(std::move(whole), bake::cameras_of(capture_), options_.web, observer_);
  }
  fit_splats();
  if (formats_.vdb) {
    for (const fs::path& file : bake_.add_volumes(volumes, "volume", options_.vdb)) observer_.wrote("volume", file);
  }
  if (bundle) write_bundle(*bundle);
}

void BakeOutput::write_bundle(const WebVolume& volume) const {
  WebScene scene{absolute_folder(capture_.root).filename().string(), bake::cameras_of(capture_), {}, label_, {}};
  if (options_.web.photo_side > 0) {
    constexpr int kQuality = 82;  // of JPEG: photographs are laid over the volume, and loaded with it
    scene.photos = make_web_photos(capture_.views, options_.web.photo_side, kQuality);
  }
  scene.sky = options_.sky;
  write_web(volume, scene, web_folder(folder_), options_.page, observer_);
}

void BakeOutput::take_mesh(const bake::Mesh& mesh) {
  fit_splats();
  const GltfFiles files = bake_.add_mesh(mesh, "mesh", formats_.exr);
  observer_.say(fmt::format("mesh: {} faces, {} charts in {} x {} texels", mesh.triangles.size(), mesh.charts,
                            mesh.texture.size, mesh.texture.size));
  observer_.wrote("mesh", files.glb);
  observer_.wrote("mesh", files.gltf);
}

void BakeOutput::fit_splats() {
  if (fit_ && !splats_) splats_ = fit_();
}

void BakeOutput::add_splats() {
  const SplatFiles files = bake_.add_splats(*splats_, "splats");
  for (const fs::path& file : {files.ply, files.spz, files.usd}) observer_.wrote("splats", file);
}

void BakeOutput::add_plates() {
  constexpr int kPlateSide = 4096, kPlateQuality = 92;
  const std::span<const View> views = capture_.views;
  const auto at_a_time = std::size_t(thread_count());
  for (std::size_t begin = 0; begin < views.size(); begin += at_a_time) {
    const auto some = views.subspan(begin, std::min(at_a_time, views.size() - begin));
    const std::vector<WebPhoto> photos = make_web_photos(some, kPlateSide, kPlateQuality);
    for (std::size_t i = 0; i < some.size(); ++i) bake_.add_plate(some[i].name, photos[i].jpeg);
  }
}

void BakeOutput::finish() {
  if (!formats_.has_manifest()) return;
  fit_splats();
  if (splats_) add_splats();
  if (options_.vdb.plates && formats_.is_for_blender()) add_plates();
  bake_.add_camera_tracks(options_.vdb);
  bake_.finish();
  if (options_.sky) observer_.wrote("sky", folder_ / "sky.exr");
  if (formats_.is_for_blender()) observer_.wrote("Blender set-up", bake_.blender_setup());
}

}  // namespace cnerf::exporting
