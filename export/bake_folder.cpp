#include "export/bake_folder.h"

#include <algorithm>

#include "export/blender_setup.h"
#include "export/color_origin.h"
#include "export/nvdb_writer.h"
#include "export/usd_writer.h"
#include "src/base/files.h"

namespace cnerf {
namespace fs = std::filesystem;

BakeFolder::BakeFolder(fs::path folder, std::vector<BakeCamera> cameras, std::vector<std::string> command_line,
                       const std::string& units, const std::string& up_axis)
    : folder_(std::move(folder)) {
  manifest_.cameras = std::move(cameras);
  manifest_.command_line = std::move(command_line);
  manifest_.units = units;
  manifest_.up_axis = up_axis;
}

fs::path BakeFolder::write_grids(const VolumePlanes& volume, const std::string& name, const VdbOptions& options) {
  const fs::path vdb = folder_ / (name + ".vdb");
  write_vdb(volume, vdb, options);
  list(vdb);
  if (options.nvdb) {
    const fs::path nvdb = folder_ / (name + ".nvdb");
    write_nvdb(volume, nvdb, options);
    list(nvdb);
  }
  return vdb;
}

fs::path BakeFolder::add_volume(const VolumePlanes& volume, const std::string& name, const VdbOptions& options) {
  const fs::path vdb = write_grids(volume, name, options);
  manifest_.colorizer = volume.colorizer;
  manifest_.take = volume.take;
  manifest_.frame = volume.frame;
  manifest_.volume = describe_volume(volume, vdb.filename().string(), options);
  return vdb;
}

fs::path BakeFolder::add_volume(const BakedVolume& volume, const std::string& name, const VdbOptions& options) {
  return add_volume(planes_of(volume), name, options);
}

std::vector<fs::path> BakeFolder::add_volumes(const std::vector<VolumePlanes>& volumes, const std::string& name,
                                              const VdbOptions& options) {
  std::vector<fs::path> files{add_volume(volumes.back(), name, options)};
  for (std::size_t finer = 1; finer < volumes.size(); ++finer) {
    const VolumePlanes& volume = volumes[volumes.size() - 1 - finer];
    const fs::path vdb = write_grids(volume, name + "_fine" + std::to_string(finer), options);
    manifest_.finer_volumes.insert(manifest_.finer_volumes.begin(),
                                   describe_volume(volume, vdb.filename().string(), options));
    files.push_back(vdb);
  }
  if (options.usd) {
    std::vector<ManifestVolume> all = manifest_.finer_volumes;
    all.push_back(*manifest_.volume);
    const fs::path usd = folder_ / (name + ".usda");
    write_usd(all, options.up == "poses" ? manifest_.up_axis : options.up, options.metres_per_unit,
              color_origin_text(manifest_.colorizer, manifest_.take), usd);
    list(usd);
    files.push_back(usd);
  }
  manifest_.metres_per_unit = options.metres_per_unit;
  return files;
}

void BakeFolder::add_plate(const std::string& camera, const std::vector<std::byte>& jpeg) {
  std::string stem = fs::path(camera).replace_extension().string();
  std::ranges::replace_if(
      stem, [](char c) { return c == '/' || c == '\\'; }, '_');
  const std::string file = "plates/" + stem + ".jpg";
  write_file(folder_ / file, jpeg);
  manifest_.files.push_back(file);
  manifest_.plates[camera] = file;
}

GltfFiles BakeFolder::add_mesh(const BakedMesh& mesh, const std::string& name, const MeshExportOptions& options) {
  const std::string color_origin = color_origin_text(mesh.colorizer, mesh.take);
  GltfScene scene;
  scene.cameras = manifest_.cameras;
  scene.basecolor_png = basecolor_png(mesh.texture);
  scene.up_axis = manifest_.up_axis;
  scene.units = manifest_.units;
  scene.color_origin = color_origin;
  if (manifest_.volume) scene.vdb = manifest_.volume->file;
  if (options.exr) {
    const TextureFiles textures = write_exr_textures(mesh.texture, color_origin, folder_, name, options.textures);
    scene.rgb_exr = textures.rgb.filename().string();
    scene.luminance_exr = textures.luminance.filename().string();
    scene.lab_exr = textures.lab.filename().string();
    for (const fs::path& file : {textures.rgb, textures.luminance, textures.lab}) list(file);
  }
  const GltfFiles files = write_gltf(mesh, scene, folder_, name);
  for (const fs::path& file : {files.glb, files.gltf, files.buffer, files.basecolor}) list(file);

  manifest_.colorizer = mesh.colorizer;
  manifest_.take = mesh.take;
  manifest_.frame = mesh.frame;
  ManifestMesh described = describe_mesh(mesh);
  described.gltf = files.gltf.filename().string();
  described.glb = files.glb.filename().string();
  described.basecolor = files.basecolor.filename().string();
  described.rgb_exr = scene.rgb_exr;
  described.luminance_exr = scene.luminance_exr;
  described.lab_exr = scene.lab_exr;
  described.gltf_from_world = gltf_from_world(manifest_.up_axis);
  manifest_.mesh = described;
  return files;
}

void BakeFolder::finish() {
  list(write_blender_setup(folder_));
  std::vector<std::string> former;
  if (fs::exists(manifest())) {
    try {
      former = read_manifest(manifest()).files;
    } catch (const std::exception&) {
      // Not a manifest of ours, so nothing here is known to be of a former bake.
    }
  }
  write_manifest(manifest_, folder_);
  for (const std::string& file : former) {
    const fs::path inside = fs::path(file).lexically_normal();
    const bool stays = std::ranges::find(manifest_.files, file) != manifest_.files.end();
    if (!stays && inside.is_relative() && *inside.begin() != "..") fs::remove(folder_ / inside);
  }
}

}  // namespace cnerf
