#include "export/manifest.h"

#include <nlohmann/json.hpp>

#include "export/manifest_json.h"
#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

Json to_json(Vec3d v) {
  return {v.x, v.y, v.z};
}
Vec3d vec3_from(const Json& j) {
  return {j.at(0).get<double>(), j.at(1).get<double>(), j.at(2).get<double>()};
}

/// Four rows; applies to column vectors.
Json to_json(const Affined& map) {
  Json rows = Json::array();
  for (int i = 0; i < 3; ++i) {
    const Vec3d& row = map.linear.rows[i];
    rows.push_back({row.x, row.y, row.z, map.translation[i]});
  }
  rows.push_back({0.0, 0.0, 0.0, 1.0});
  return rows;
}
Affined affine_from(const Json& rows) {
  Affined map;
  for (int i = 0; i < 3; ++i) {
    map.linear.rows[i] = vec3_from(rows.at(i));
    map.translation[i] = rows.at(i).at(3).get<double>();
  }
  return map;
}

const std::vector<std::pair<LensModel, std::string>> kLensNames{
    {LensModel::kPinhole, "pinhole"}, {LensModel::kOpenCv, "opencv"}, {LensModel::kOpenCvFisheye, "opencv_fisheye"}};

Json to_json(const BakeCamera& camera) {
  const Intrinsics& lens = camera.intrinsics;
  std::string model;
  for (const auto& [value, name] : kLensNames) {
    if (value == lens.model) model = name;
  }
  return {{"name", camera.name},
          {"width", lens.width},
          {"height", lens.height},
          {"fx", lens.fx},
          {"fy", lens.fy},
          {"cx", lens.cx},
          {"cy", lens.cy},
          {"model", model},
          {"distortion", lens.distortion},
          {"world_from_camera", to_json(camera.world_from_camera)}};
}

BakeCamera camera_from(const Json& j) {
  BakeCamera camera;
  Intrinsics& lens = camera.intrinsics;
  camera.name = j.at("name").get<std::string>();
  lens.width = j.at("width").get<int>();
  lens.height = j.at("height").get<int>();
  lens.fx = j.at("fx").get<double>();
  lens.fy = j.at("fy").get<double>();
  lens.cx = j.at("cx").get<double>();
  lens.cy = j.at("cy").get<double>();
  for (const auto& [value, name] : kLensNames) {
    if (name == j.at("model").get<std::string>()) lens.model = value;
  }
  lens.distortion = j.at("distortion").get<std::array<double, 8>>();
  camera.world_from_camera = affine_from(j.at("world_from_camera"));
  return camera;
}

Json to_json(const ManifestVolume& volume) {
  return {{"file", volume.file},
          {"bounds", {{"min", to_json(volume.bounds.min)}, {"max", to_json(volume.bounds.max)}}},
          {"voxel_size", volume.voxel_size},
          {"resolution", {volume.resolution.x, volume.resolution.y, volume.resolution.z}},
          {"voxels", volume.voxels},
          {"max_density", volume.max_density},
          {"density_unit", "1/world unit"},
          {"voxel_origin", volume.voxel_origin},
          {"half_density", volume.half_density},
          {"density_scale", volume.density_scale},
          {"file_from_world", to_json(volume.file_from_world)},
          {"world_from_file", to_json(volume.file_from_world.inverse())}};
}

ManifestVolume volume_from(const Json& j) {
  ManifestVolume volume;
  volume.file = j.at("file").get<std::string>();
  volume.bounds = {vec3_from(j.at("bounds").at("min")), vec3_from(j.at("bounds").at("max"))};
  volume.voxel_size = j.at("voxel_size").get<double>();
  volume.resolution = vec3_from(j.at("resolution")).cast<int>();
  volume.voxels = j.at("voxels").get<std::size_t>();
  volume.max_density = j.at("max_density").get<double>();
  volume.voxel_origin = j.at("voxel_origin").get<std::string>();
  volume.half_density = j.at("half_density").get<bool>();
  volume.density_scale = j.value("density_scale", 1.0);
  if (j.contains("file_from_world")) volume.file_from_world = affine_from(j.at("file_from_world"));
  return volume;
}

Json to_json(const ManifestMesh& mesh) {
  const Json textures{{"basecolor", {{"file", mesh.basecolor}, {"space", "sRGB, 8 bit"}}},
                      {"rgb", {{"file", mesh.rgb_exr}, {"space", "lin_rec709"}}},
                      {"luminance", {{"file", mesh.luminance_exr}, {"space", "linear luminance, Rec.709 Y"}}},
                      {"lab", {{"file", mesh.lab_exr}, {"space", "CIE 1976 L*a*b*, D65, 2 degrees; data"}}}};
  return {{"gltf", mesh.gltf},
          {"glb", mesh.glb},
          {"textures", textures},
          {"bounds", {{"min", to_json(mesh.bounds.min)}, {"max", to_json(mesh.bounds.max)}}},
          {"vertices", mesh.vertices},
          {"faces", mesh.faces},
          {"texture_size", mesh.texture_size},
          {"gutter", mesh.gutter},
          {"charts", mesh.charts},
          {"voxel_size", mesh.voxel_size},
          {"gltf_from_world", to_json(mesh.gltf_from_world)},
          {"world_from_gltf", to_json(mesh.gltf_from_world.inverse())}};
}

ManifestMesh mesh_from(const Json& j) {
  ManifestMesh mesh;
  const auto texture = [&](const char* name) { return j.at("textures").at(name).at("file").get<std::string>(); };
  mesh.gltf = j.at("gltf").get<std::string>();
  mesh.glb = j.at("glb").get<std::string>();
  mesh.basecolor = texture("basecolor");
  mesh.rgb_exr = texture("rgb");
  mesh.luminance_exr = texture("luminance");
  mesh.lab_exr = texture("lab");
  mesh.bounds = {vec3_from(j.at("bounds").at("min")), vec3_from(j.at("bounds").at("max"))};
  mesh.vertices = j.at("vertices").get<std::size_t>();
  mesh.faces = j.at("faces").get<std::size_t>();
  mesh.texture_size = j.at("texture_size").get<int>();
  mesh.gutter = j.at("gutter").get<int>();
  mesh.charts = j.at("charts").get<int>();
  mesh.voxel_size = j.at("voxel_size").get<double>();
  mesh.gltf_from_world = affine_from(j.at("gltf_from_world"));
  return mesh;
}

Json to_json(const SceneFrame& frame) {
  const double scale = frame.unit_per_world;
  const Affined unit_from_world{Mat3d::identity() * scale, frame.unit_from_world({0, 0, 0})};
  return {{"name", "source"},
          {"meaning", "world is the frame the camera poses came in"},
          {"world_centre", to_json(frame.world_centre)},
          {"unit_per_world", scale},
          {"cascades", frame.cascades},
          {"unit_from_world", to_json(unit_from_world)},
          {"world_from_unit", to_json(unit_from_world.inverse())}};
}

SceneFrame frame_from(const Json& j) {
  return {vec3_from(j.at("world_centre")), j.at("unit_per_world").get<double>(), j.at("cascades").get<int>()};
}

Json describe_files(const std::vector<std::string>& files, const fs::path& folder) {
  Json list = Json::array();
  for (const std::string& name : files) {
    const std::string checksum = sha256_of_file(folder / name);
    list.push_back({{"name", name}, {"bytes", fs::file_size(folder / name)}, {"sha256", checksum}});
  }
  return list;
}

BakeManifest manifest_from(const Json& j) {
  BakeManifest manifest;
  manifest.command_line = j.at("command_line").get<std::vector<std::string>>();
  for (const Json& file : j.at("files")) manifest.files.push_back(file.at("name").get<std::string>());
  manifest.units = j.at("units").get<std::string>();
  manifest.up_axis = j.at("up_axis").get<std::string>();
  manifest.colorizer = j.at("color").at("colorizer").get<std::string>();
  manifest.take = j.at("color").at("take").get<std::string>();
  manifest.frame = frame_from(j.at("frame"));
  manifest.metres_per_unit = j.value("metres_per_unit", 1.0);
  for (const Json& camera : j.at("cameras")) {
    manifest.cameras.push_back(camera_from(camera));
    if (camera.contains("plate")) manifest.plates[manifest.cameras.back().name] = camera.at("plate").get<std::string>();
  }
  if (!j.at("volume").is_null()) manifest.volume = volume_from(j.at("volume"));
  if (j.contains("finer_volumes")) {
    for (const Json& volume : j.at("finer_volumes")) manifest.finer_volumes.push_back(volume_from(volume));
  }
  if (j.contains("mesh") && !j.at("mesh").is_null()) manifest.mesh = mesh_from(j.at("mesh"));
  return manifest;
}

}  // namespace

Json camera_json(const BakeCamera& camera) {
  return to_json(camera);
}
Json frame_json(const SceneFrame& frame) {
  return to_json(frame);
}
Json color_json(const std::string& colorizer, const std::string& take) {
  return {{"space", "lin_rec709"},
          {"white", "D65"},
          {"inferred", !colorizer.empty()},
          {"colorizer", colorizer},
          {"take", take}};
}

ManifestVolume describe_volume(const VolumePlanes& volume, const std::string& file, const VdbOptions& options) {
  const VolumeStatistics statistics = statistics_of(volume);
  const VoxelBox& box = statistics.dense;
  const double h = volume.voxel_size;
  ManifestVolume described;
  described.file = file;
  described.bounds = {volume.origin + box.min.cast<double>() * h,
                      volume.origin + (box.min + box.size).cast<double>() * h};
  described.voxel_size = h;
  described.resolution = volume.resolution;
  described.voxels = statistics.voxels;
  described.max_density = statistics.max_sigma;
  described.voxel_origin = options.voxel_origin;
  described.half_density = density_fits_half(statistics, options);
  described.density_scale = density_scale(statistics, options);
  described.file_from_world = file_from_world(options);
  return described;
}

ManifestMesh describe_mesh(const BakedMesh& mesh) {
  ManifestMesh described;
  described.bounds = Aabbd::empty();
  for (const Vec3f& p : mesh.positions) described.bounds.grow(p.cast<double>());
  described.vertices = mesh.positions.size();
  described.faces = mesh.triangles.size();
  described.texture_size = mesh.texture.size;
  described.gutter = mesh.gutter;
  described.charts = mesh.charts;
  described.voxel_size = mesh.voxel_size;
  return described;
}

fs::path write_manifest(const BakeManifest& manifest, const fs::path& folder) {
  Json cameras = Json::array();
  for (const BakeCamera& camera : manifest.cameras) {
    cameras.push_back(to_json(camera));
    const auto plate = manifest.plates.find(camera.name);
    if (plate != manifest.plates.end()) cameras.back()["plate"] = plate->second;
  }
  Json finer = Json::array();
  for (const ManifestVolume& volume : manifest.finer_volumes) finer.push_back(to_json(volume));
  const Json j{{"schema", kManifestSchema},
               {"program", "cnerf"},
               {"program_version", CNERF_VERSION},
               {"command_line", manifest.command_line},
               {"files", describe_files(manifest.files, folder)},
               {"units", manifest.units},
               {"up_axis", manifest.up_axis},
               {"metres_per_unit", manifest.metres_per_unit},
               {"color", color_json(manifest.colorizer, manifest.take)},
               {"frame", to_json(manifest.frame)},
               {"volume", manifest.volume ? to_json(*manifest.volume) : Json(nullptr)},
               {"finer_volumes", finer},
               {"mesh", manifest.mesh ? to_json(*manifest.mesh) : Json(nullptr)},
               {"camera_axes", "+X right, +Y down, +Z forward; centre of the first pixel at (0.5, 0.5)"},
               {"cameras", cameras}};
  const fs::path file = folder / "manifest.json";
  write_file(file, j.dump(2) + "\n");
  return file;
}

BakeManifest read_manifest(const fs::path& file) {
  const std::string text = read_text_file(file);
  try {
    const Json j = Json::parse(text);
    const int schema = j.at("schema").get<int>();
    if (schema > kManifestSchema) {
      throw InputError(file, "schema",
                       "expected at most " + std::to_string(kManifestSchema) + ", found " + std::to_string(schema) +
                           ": written by a newer cnerf");
    }
    return manifest_from(j);
  } catch (const nlohmann::json::exception& failure) {
    throw InputError(file, "", failure.what());
  }
}

}  // namespace cnerf
