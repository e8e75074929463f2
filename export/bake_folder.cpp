#include "export/bake_folder.h"

#include "export/blender_setup.h"
#include "export/color_origin.h"

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

fs::path BakeFolder::add_volume(const BakedVolume& volume, const std::string& name, const VdbOptions& options) {
  const fs::path vdb = folder_ / (name + ".vdb");
  write_vdb(volume, vdb, options);
  list(vdb);
  manifest_.colorizer = volume.colorizer;
  manifest_.take = volume.take;
  manifest_.frame = volume.frame;
  manifest_.volume = describe_volume(volume, vdb.filename().string(), options);
  return vdb;
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
  write_manifest(manifest_, folder_);
}

}  // namespace cnerf
