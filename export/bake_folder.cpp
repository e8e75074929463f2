#include "export/bake_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "export/camera_tracks.h"
#include "export/texture_writer.h"
#include "export/usd_text.h"
#include "export/vdb_writer.h"
#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/picture/exr_writer.h"

namespace cnerf::exporting {
namespace fs = std::filesystem;
namespace {

struct Field {
  const char *name, *data_type, *role;
};
constexpr Field kFields[] = {{"density", "float", ""},
                             {"color", "float3", "Color"},
                             {"luminance", "float", ""},
                             {"lab_a", "float", ""},
                             {"lab_b", "float", ""}};

std::string volume_prim(const ManifestVolume& volume, std::size_t number) {
  std::string text = fmt::format("    def Volume \"grid_{}\"\n    {{\n", number);
  Aabbd box = Aabbd::empty();  // of the file
  box.grow(volume.file_from_world.point(volume.bounds.min));
  box.grow(volume.file_from_world.point(volume.bounds.max));
  const Vec3d low = box.min, high = box.max;
  text += fmt::format("        float3[] extent = [({}, {}, {}), ({}, {}, {})]\n", low.x, low.y, low.z, high.x, high.y,
                      high.z);
  for (const Field& field : kFields) {
    text += fmt::format("        rel field:{0} = </cnerf/grid_{1}/{0}>\n", field.name, number);
  }
  for (const Field& field : kFields) {
    text += fmt::format(
        "\n        def OpenVDBAsset \"{0}\"\n        {{\n            token fieldClass = \"fogVolume\"\n"
        "            token fieldName = \"{0}\"\n            token fieldDataType = \"{1}\"\n",
        field.name, field.data_type);
    if (*field.role != 0) text += fmt::format("            token vectorDataRoleHint = \"{}\"\n", field.role);
    text += fmt::format("            asset filePath = @./{}@\n        }}\n", volume.file);
  }
  return text + "    }\n";
}

/// Writes a .usda with one Volume prim for each file and an OpenVDBAsset field for each of its grids `density`,
/// `color`, `luminance`, `lab_a`, `lab_b`. Files are named relative to the scene.
/// @param up_axis  of the files' world, "x", "y" or "z".
/// @throws OutputError.
void write_usd(const std::vector<ManifestVolume>& volumes, const std::string& up_axis, const Label& label,
               const std::filesystem::path& file) {
  std::string text = usd_begin(up_axis, label);
  for (std::size_t v = 0; v < volumes.size(); ++v) text += volume_prim(volumes[v], v);
  write_file(file, text + "}\n");
}

}  // namespace

fs::path write_blender_setup(const fs::path& folder) {
  const std::string marker = "BAKE_FOLDER = \"\"";
  std::string text = blender_setup_text();
  const std::size_t at = text.find(marker);
  CNERF_CHECK(at != std::string::npos, "blender_setup.py lost its BAKE_FOLDER line");
  // A JSON string in UTF-8 is a Python string literal as well. In ASCII it is not: beyond U+FFFF JSON escapes two
  // surrogates, and Python keeps both. What is not UTF-8 is replaced: only a script that is pasted misses its folder.
  const std::string literal = nlohmann::json(fs::absolute(folder).lexically_normal().string())
                                  .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  text.replace(at, marker.size(), "BAKE_FOLDER = " + literal);
  fs::path target = folder / "blender_setup.py";
  write_file(target, text);
  return target;
}

BakeFolder::BakeFolder(fs::path folder, std::vector<bake::Camera> cameras, Label label) : folder_(std::move(folder)) {
  manifest_.cameras = std::move(cameras);
  manifest_.label = std::move(label);
}

/// To be called before a file is replaced that a former manifest may list.
void BakeFolder::begin() {
  if (std::exchange(has_begun_, true)) return;
  std::error_code failure;
  fs::rename(manifest(), former_manifest(), failure);
  if (failure && failure != std::errc::no_such_file_or_directory) {
    throw OutputError(manifest().string() + ": cannot be moved: " + failure.message());
  }
  if (sky_) write_sky();
}

ManifestVolume BakeFolder::write_grids(const bake::VolumePlanes& volume, const std::string& name,
                                       const VdbOptions& options) {
  begin();
  const fs::path vdb = folder_ / (name + ".vdb");
  write_vdb(volume, vdb, options, manifest_.label);
  list(vdb);
  if (options.nvdb) {
    const fs::path nvdb = folder_ / (name + ".nvdb");
    write_nvdb(volume, nvdb, options, manifest_.label);
    list(nvdb);
  }
  return describe_volume(volume, vdb.filename().string(), options, manifest_.label.world);
}

std::vector<fs::path> BakeFolder::add_volumes(const std::vector<bake::VolumePlanes>& volumes, const std::string& name,
                                              const VdbOptions& options) {
  const bake::VolumePlanes& coarsest = volumes.back();
  manifest_.frame = coarsest.frame;
  manifest_.volume = write_grids(coarsest, name, options);
  std::vector<ManifestVolume> all{*manifest_.volume};  // coarsest first
  for (std::size_t finer = 1; finer < volumes.size(); ++finer) {
    all.push_back(write_grids(volumes[volumes.size() - 1 - finer], name + "_fine" + std::to_string(finer), options));
  }
  std::vector<fs::path> files;
  for (const ManifestVolume& volume : all) files.push_back(folder_ / volume.file);
  std::ranges::reverse(all);
  manifest_.finer_volumes.assign(all.begin(), all.end() - 1);
  if (options.usd) {
    const fs::path usd = folder_ / (name + ".usda");
    write_usd(all, up_axis_of_file(options, manifest_.label.world), manifest_.label, usd);
    list(usd);
    files.push_back(usd);
  }
  return files;
}

void BakeFolder::add_sky(const SkyPicture& sky) {
  sky_ = sky;
  manifest_.sky = ManifestSky{"sky.exr"};
  list(manifest_.sky->file);
}

void BakeFolder::write_sky() const {
  const std::span<const float> rgb(sky_->rgb);
  write_exr(folder_ / manifest_.sky->file,
            {sky_->width,
             sky_->height,
             {{"R", rgb, 3, true}, {"G", rgb.subspan(1), 3, true}, {"B", rgb.subspan(2), 3, true}},
             {{"software", "cnerf " CNERF_VERSION},
              {"colorOrigin", color_origin_text(manifest_.label.provenance)},
              {"colorSpace", "lin_rec709"}}});
}

void BakeFolder::add_camera_tracks(const VdbOptions& options) {
  begin();
  const fs::path usd = folder_ / "cameras.usda", chan = folder_ / "cameras.chan";
  write_cameras_usd(manifest_.cameras, options, manifest_.label, usd);
  write_chan(manifest_.cameras, manifest_.label.world, chan);
  list(usd);
  list(chan);
}

void BakeFolder::add_plate(const std::string& camera, const std::vector<std::byte>& jpeg) {
  begin();
  const std::string file = "plates/" + plate_names_.name_for(camera) + ".jpg";
  write_file(folder_ / file, jpeg);
  manifest_.files.push_back(file);
  manifest_.plates[camera] = file;
}

GltfFiles BakeFolder::add_mesh(const bake::Mesh& mesh, const std::string& name, bool exr) {
  begin();
  GltfScene scene;
  scene.cameras = manifest_.cameras;
  scene.basecolor_png = basecolor_png(mesh.texture);
  scene.label = manifest_.label;
  if (manifest_.volume) scene.vdb = manifest_.volume->file;
  if (manifest_.sky) scene.sky = manifest_.sky->file;
  if (exr) {
    const TextureFiles textures =
        write_exr_textures(mesh.texture, color_origin_text(manifest_.label.provenance), folder_, name);
    scene.rgb_exr = textures.rgb.filename().string();
    scene.luminance_exr = textures.luminance.filename().string();
    scene.lab_exr = textures.lab.filename().string();
    for (const fs::path& file : {textures.rgb, textures.luminance, textures.lab}) list(file);
  }
  GltfFiles files = write_gltf(mesh, scene, folder_, name);
  for (const fs::path& file : {files.glb, files.gltf, files.buffer, files.basecolor}) list(file);

  manifest_.frame = mesh.frame;
  ManifestMesh described = describe_mesh(mesh);
  described.gltf = files.gltf.filename().string();
  described.glb = files.glb.filename().string();
  described.basecolor = files.basecolor.filename().string();
  described.rgb_exr = scene.rgb_exr;
  described.luminance_exr = scene.luminance_exr;
  described.lab_exr = scene.lab_exr;
  described.gltf_from_world = gltf_from_world(manifest_.label.world);
  manifest_.mesh = described;
  return files;
}

SplatFiles BakeFolder::add_splats(const bake::SplatCloud& cloud, const std::string& name) {
  begin();
  SplatFiles files = write_splats(cloud, folder_, name, manifest_.label);
  for (const fs::path& file : {files.ply, files.spz, files.usd}) list(file);
  if (!manifest_.volume && !manifest_.mesh) manifest_.frame = cloud.frame;
  manifest_.splats = describe_splats(cloud);
  manifest_.splats->ply = files.ply.filename().string();
  manifest_.splats->spz = files.spz.filename().string();
  manifest_.splats->usd = files.usd.filename().string();
  return files;
}

void BakeFolder::finish() {
  begin();
  if (manifest_.volume || manifest_.mesh) list(write_blender_setup(folder_));
  std::vector<std::string> former;
  if (fs::exists(former_manifest())) {
    try {
      former = read_manifest(former_manifest()).files;
    } catch (const std::exception&) {
      // Not a manifest of ours, so nothing here is known to be of a former bake.
    }
  }
  write_manifest(manifest_, folder_);
  for (const std::string& file : former) {
    if (std::ranges::find(manifest_.files, file) != manifest_.files.end()) continue;
    if (const auto ours = file_below(folder_, file)) remove_output(*ours);  // a manifest may come from anybody
  }
  remove_output(former_manifest());
}

}  // namespace cnerf::exporting
