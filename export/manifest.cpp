#include "export/manifest.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "export/splat_writer.h"
#include "export/vec3_json.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/json_record.h"
#include "src/capture/camera_record.h"
#include "src/capture/pose.h"

namespace nlohmann {

/// Four rows; applies to column vectors.
template <>
struct adl_serializer<cnerf::Affined> {
  template <typename Json>
  static void to_json(Json& json, const cnerf::Affined& map) {
    json = Json::array();
    for (int i = 0; i < 3; ++i) {
      const cnerf::Vec3d& row = map.linear.rows[i];
      json.push_back({row.x, row.y, row.z, map.translation[i]});
    }
    json.push_back({0.0, 0.0, 0.0, 1.0});
  }
  template <typename Json>
  static void from_json(const Json& json, cnerf::Affined& map) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Json& row = json.at(i);
      if (row.size() != 4) throw Json::type_error::create(302, "expected four numbers", &row);
      for (std::size_t column = 0; column < 3; ++column) row.at(column).get_to(map.linear.rows[i][int(column)]);
      row.at(3).get_to(map.translation[int(i)]);
    }
  }
};

}  // namespace nlohmann

namespace cnerf {

NLOHMANN_JSON_SERIALIZE_ENUM(LensModel, {{LensModel::kPinhole, "pinhole"},
                                         {LensModel::kOpenCv, "opencv"},
                                         {LensModel::kOpenCvFisheye, "opencv_fisheye"}})

}  // namespace cnerf

namespace cnerf::exporting {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

/// What says how to read a file and is the same in all of them.
using Text = const std::string;

/// A camera of the capture and what shows behind its view.
struct CameraRecord {
  bake::Camera camera;
  std::optional<std::string> plate;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    auto& lens = self.camera.intrinsics;
    v("name", self.camera.name);
    LensRecord::visit(lens, v);
    v("model", lens.model);
    v("distortion", lens.distortion);
    v("world_from_camera", self.camera.world_from_camera);
    v("plate", self.plate);
  }
};

struct FrameRecord {
  SceneFrame frame;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    static Text name = "source", meaning = "world is the frame the camera poses came in";
    const SceneFrame& frame = self.frame;
    const Affined unit_from_world{Mat3d::identity() * frame.unit_per_world, frame.unit_from_world({0, 0, 0})};
    const Affined world_from_unit = unit_from_world.inverse();
    v("name", name, kWritten);
    v("meaning", meaning, kWritten);
    v("world_centre", self.frame.world_centre);
    v("unit_per_world", self.frame.unit_per_world);
    v("cascades", self.frame.cascades);
    v("unit_from_world", unit_from_world, kWritten);
    v("world_from_unit", world_from_unit, kWritten);
  }
};

struct ColorRecord {
  std::string colorizer, take;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    static Text space = "lin_rec709", white = "D65";
    const bool is_inferred = !self.colorizer.empty();
    v("space", space, kWritten);
    v("white", white, kWritten);
    v("inferred", is_inferred, kWritten);
    v("colorizer", self.colorizer);
    v("take", self.take);
  }
};

struct TextureRecord {
  std::string file, space;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("file", self.file);
    v("space", self.space, kLater);
  }
};

struct TexturesRecord {
  TextureRecord basecolor, rgb, luminance, lab;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("basecolor", self.basecolor);
    v("rgb", self.rgb);
    v("luminance", self.luminance);
    v("lab", self.lab);
  }
};

struct FileRecord {
  std::string name;
  std::uintmax_t bytes = 0;
  std::string sha256;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("name", self.name);
    v("bytes", self.bytes, kLater);
    v("sha256", self.sha256, kLater);
  }
};

/// All of the file.
struct ManifestRecord {
  int schema = kManifestSchema;
  BakeManifest manifest;
  std::vector<FileRecord> files;
  ColorRecord color;
  FrameRecord frame;
  std::vector<CameraRecord> cameras;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    static Text program = "cnerf", version = CNERF_VERSION;
    static Text axes = "+X right, +Y down, +Z forward; centre of the first pixel at (0.5, 0.5)";
    auto& [provenance, world] = self.manifest.label;
    v("schema", self.schema);
    v("program", program, kWritten);
    v("program_version", version, kWritten);
    v("command_line", provenance.command_line);
    v("files", self.files);
    v("units", world.units);
    v("up_axis", world.up_axis);
    v("metres_per_unit", world.metres_per_unit, kLater);
    v("color", self.color);
    v("frame", self.frame);
    v("volume", self.manifest.volume, kNullable);
    v("finer_volumes", self.manifest.finer_volumes, kLater);
    v("mesh", self.manifest.mesh, kNullable);
    v("sky", self.manifest.sky, kLater);
    v("splats", self.manifest.splats);
    v("camera_axes", axes, kWritten);
    v("cameras", self.cameras);
  }
};

/// @throws InputError  for a camera that no picture can be rendered for
void check_camera(const fs::path& file, std::size_t number, const bake::Camera& camera) {
  constexpr int kLargestSide = 1 << 15;
  constexpr double kMostPixels = 1 << 28;
  constexpr std::size_t kLongestName = 4096;
  const auto refuse = [&](const std::string& field, const std::string& problem) {
    throw InputError(file, "cameras[" + std::to_string(number) + "]." + field, problem);
  };
  const Intrinsics& lens = camera.intrinsics;
  const auto is_side = [](int side) { return side > 0 && side <= kLargestSide; };
  if (!is_side(lens.width) || !is_side(lens.height) || double(lens.width) * lens.height > kMostPixels) {
    refuse("width, height", "expected 1 to 32768 pixels each and at most 2^28, found " + std::to_string(lens.width) +
                                " x " + std::to_string(lens.height));
  }
  const Affined& pose = camera.world_from_camera;
  if (const auto found = implausible_number(lens, pose.translation)) refuse(found->field, found->problem);
  (void)rigid_pose(pose, file, "cameras[" + std::to_string(number) + "].world_from_camera");
  // Pictures are named by it.
  if (camera.name.size() > kLongestName) refuse("name", "expected at most " + std::to_string(kLongestName) + " bytes");
}

}  // namespace

template <typename Self, typename Visitor>
void ManifestVolume::visit(Self& self, Visitor&& v) {
  static Text unit = "1/world unit";
  const Affined world_from_file = self.file_from_world.inverse();
  v("file", self.file);
  v("bounds", self.bounds);
  v("voxel_size", self.voxel_size);
  v("resolution", self.resolution);
  v("voxels", self.voxels);
  v("max_density", self.max_density);
  v("density_unit", unit, kWritten);
  v("voxel_origin", self.voxel_origin);
  v("half_density", self.half_density);
  v("density_scale", self.density_scale, kLater);
  v("file_from_world", self.file_from_world, kLater);
  v("world_from_file", world_from_file, kWritten);
}

template <typename Self, typename Visitor>
void ManifestSky::visit(Self& self, Visitor&& v) {
  static Text layout = "equirectangular, axes of the poses' frame: +x in the middle, +z up, +y a quarter to the left";
  static Text space = "lin_rec709";
  v("file", self.file);
  v("layout", layout, kWritten);
  v("space", space, kWritten);
}

template <typename Self, typename Visitor>
void ManifestMesh::visit(Self& self, Visitor&& v) {
  TexturesRecord textures{{self.basecolor, "sRGB, 8 bit"},
                          {self.rgb_exr, "lin_rec709"},
                          {self.luminance_exr, "linear luminance, Rec.709 Y"},
                          {self.lab_exr, "CIE 1976 L*a*b*, D65, 2 degrees; data"}};
  const Affined world_from_gltf = self.gltf_from_world.inverse();
  v("gltf", self.gltf);
  v("glb", self.glb);
  v("textures", textures);
  v("bounds", self.bounds);
  v("vertices", self.vertices);
  v("faces", self.faces);
  v("texture_size", self.texture_size);
  v("gutter", self.gutter);
  v("charts", self.charts);
  v("voxel_size", self.voxel_size);
  v("gltf_from_world", self.gltf_from_world);
  v("world_from_gltf", world_from_gltf, kWritten);
  if constexpr (!std::is_const_v<Self>) {
    self.basecolor = textures.basecolor.file;
    self.rgb_exr = textures.rgb.file;
    self.luminance_exr = textures.luminance.file;
    self.lab_exr = textures.lab.file;
  }
}

template <typename Self, typename Visitor>
void ManifestSplats::visit(Self& self, Visitor&& v) {
  static Text space = "sRGB-encoded", frame = "world";
  v("ply", self.ply);
  v("spz", self.spz);
  v("usd", self.usd);
  v("bounds", self.bounds);
  v("count", self.count);
  v("degree", self.degree);
  v("color_space", space, kWritten);
  v("frame", frame, kWritten);
}

Json camera_json(const bake::Camera& camera) {
  return json_of(CameraRecord{camera, {}});
}
Json frame_json(const SceneFrame& frame) {
  return json_of(FrameRecord{frame});
}
Json color_json(const bake::Provenance& provenance) {
  return json_of(ColorRecord{provenance.colorizer, provenance.take});
}

ManifestVolume describe_volume(const bake::VolumePlanes& volume, const std::string& file, const VdbOptions& options,
                               const WorldConvention& world) {
  const bake::VolumeStatistics& statistics = volume.statistics;
  const bake::VoxelBox& box = statistics.dense;
  const double h = volume.voxel_size;
  ManifestVolume described;
  described.file = file;
  described.bounds = {volume.origin + box.low.cast<double>() * h, volume.origin + box.high.cast<double>() * h};
  described.voxel_size = h;
  described.resolution = volume.resolution;
  described.voxels = statistics.voxels;
  described.max_density = statistics.max_sigma;
  described.voxel_origin = options.voxel_origin;
  described.half_density = density_fits_half(statistics);
  described.file_from_world = file_from_world(options, world);
  return described;
}

ManifestMesh describe_mesh(const bake::Mesh& mesh) {
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

ManifestSplats describe_splats(const bake::SplatCloud& cloud) {
  ManifestSplats described;
  described.bounds = Aabbd::empty();
  for (const bake::Splat& splat : cloud.splats) described.bounds.grow(splat.position.cast<double>());
  described.count = cloud.splats.size();
  described.degree = kSplatDegree;
  return described;
}

fs::path write_manifest(const BakeManifest& manifest, const fs::path& folder) {
  ManifestRecord record{
      kManifestSchema,  manifest, {}, {manifest.label.provenance.colorizer, manifest.label.provenance.take},
      {manifest.frame}, {}};
  for (const std::string& name : manifest.files) {
    std::string checksum = sha256_of_file(folder / name);
    record.files.push_back({name, fs::file_size(folder / name), std::move(checksum)});
  }
  for (const bake::Camera& camera : manifest.cameras) {
    const auto plate = manifest.plates.find(camera.name);
    record.cameras.push_back({camera, plate == manifest.plates.end() ? std::nullopt : std::optional(plate->second)});
  }
  fs::path file = folder / "manifest.json";
  write_file(file, json_of(record).dump(2) + "\n");
  return file;
}

BakeManifest read_manifest(const fs::path& file) {
  const Json json = read_json(file);
  const Json schema = json.is_object() ? json.value("schema", Json()) : Json();
  if (schema.is_number_integer() && schema.get<std::int64_t>() > kManifestSchema) {
    throw InputError(file, "schema",
                     "expected at most " + std::to_string(kManifestSchema) + ", found " + excerpt(schema) +
                         ": written by a newer cnerf");
  }
  auto record = record_of<ManifestRecord>(json, file);
  BakeManifest& manifest = record.manifest;
  manifest.label.provenance.colorizer = record.color.colorizer;
  manifest.label.provenance.take = record.color.take;
  manifest.frame = record.frame.frame;
  for (const FileRecord& each : record.files) {
    manifest.files.push_back(each.name);
    if (!each.sha256.empty()) manifest.states[each.name] = {each.bytes, each.sha256};
  }
  for (const CameraRecord& each : record.cameras) {
    check_camera(file, manifest.cameras.size(), each.camera);
    manifest.cameras.push_back(each.camera);
    if (each.plate) manifest.plates[each.camera.name] = *each.plate;
  }
  return std::move(manifest);
}

std::optional<fs::path> file_below(const fs::path& folder, const std::string& name) {
  const fs::path inside = fs::path(name).lexically_normal();
  if (name.empty() || inside.is_absolute() || !inside.has_filename() || *inside.begin() == "..") return std::nullopt;
  std::error_code failure;
  const fs::path root = fs::canonical(folder, failure);
  const fs::path parent = fs::canonical(root / inside.parent_path(), failure);  // resolves links
  if (failure || std::mismatch(root.begin(), root.end(), parent.begin(), parent.end()).first != root.end()) {
    return std::nullopt;
  }
  fs::path file = parent / inside.filename();
  if (!fs::is_regular_file(fs::symlink_status(file, failure))) return std::nullopt;
  return file;
}

void check_listed_file(const BakeManifest& manifest, const fs::path& folder, const std::string& name) {
  const fs::path manifest_file = folder / "manifest.json";
  const auto state = manifest.states.find(name);
  std::error_code failure;
  if (std::ranges::find(manifest.files, name) == manifest.files.end()) {
    throw InputError(manifest_file, "files", "expected " + name + " among them");
  }
  if (fs::symlink_status(folder / name, failure).type() == fs::file_type::not_found) {
    throw MissingInputError((folder / name).string() + ": no such file");
  }
  const auto file = file_below(folder, name);
  if (!file) throw InputError(manifest_file, "files", name + " is no file in this folder");
  if (state == manifest.states.end()) return;
  const std::uintmax_t bytes = fs::file_size(*file, failure);
  if (bytes != state->second.bytes) {
    throw InputError(*file, "size",
                     "expected " + std::to_string(state->second.bytes) + " bytes as " + manifest_file.string() +
                         " says, found " + std::to_string(bytes));
  }
  if (sha256_of_file(*file) != state->second.sha256) {
    throw InputError(*file, "SHA-256",
                     "is not that of " + manifest_file.string() + ": the file was changed after the bake");
  }
}

}  // namespace cnerf::exporting
