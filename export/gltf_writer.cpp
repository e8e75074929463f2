#include "export/gltf_writer.h"

#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <sstream>

#include "export/up_axis.h"
#include "src/base/aabb.h"
#include "src/base/check.h"
#include "src/base/files.h"

namespace cnerf::exporting {
namespace {

tinygltf::Value value_from(const nlohmann::json& json) {
  if (json.is_object()) {
    tinygltf::Value::Object object;
    for (const auto& [key, member] : json.items()) object[key] = value_from(member);
    return tinygltf::Value(std::move(object));
  }
  if (json.is_array()) {
    tinygltf::Value::Array array;
    for (const nlohmann::json& element : json) array.push_back(value_from(element));
    return tinygltf::Value(std::move(array));
  }
  if (json.is_boolean()) return tinygltf::Value(json.get<bool>());
  if (json.is_number_integer()) return tinygltf::Value(json.get<int>());
  if (json.is_number()) return tinygltf::Value(json.get<double>());
  return tinygltf::Value(json.get<std::string>());
}

/// Extras are objects with one member of ours, so that others can add theirs.
tinygltf::Value extras(const nlohmann::json& ours) {
  return value_from({{"cnerf", ours}});
}

/// Bytes that accessors and images point into; every piece starts at a multiple of four.
class BufferBuilder {
 public:
  explicit BufferBuilder(tinygltf::Model& model) : model_(model) { model_.buffers.resize(1); }
  int add_view(const void* data, std::size_t bytes, int target) {
    std::vector<unsigned char>& buffer = model_.buffers[0].data;
    buffer.resize((buffer.size() + 3) / 4 * 4);
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = buffer.size();
    view.byteLength = bytes;
    view.target = target;
    const auto* begin = static_cast<const unsigned char*>(data);
    buffer.insert(buffer.end(), begin, begin + bytes);
    model_.bufferViews.push_back(view);
    return int(model_.bufferViews.size()) - 1;
  }
  int add_accessor(int view, std::size_t count, int component, int type) {
    tinygltf::Accessor accessor;
    accessor.bufferView = view;
    accessor.componentType = component;
    accessor.count = count;
    accessor.type = type;
    model_.accessors.push_back(accessor);
    return int(model_.accessors.size()) - 1;
  }
  int add_vectors(const std::vector<Vec3f>& values) {
    const int view = add_view(values.data(), values.size() * sizeof(Vec3f), TINYGLTF_TARGET_ARRAY_BUFFER);
    return add_accessor(view, values.size(), TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3);
  }

 private:
  tinygltf::Model& model_;
};

std::vector<Vec3f> mapped(const std::vector<Vec3f>& values, const Mat3d& linear) {
  std::vector<Vec3f> result;
  for (const Vec3f& value : values) {
    CNERF_CHECK(std::isfinite(value.x) && std::isfinite(value.y) && std::isfinite(value.z),
                "mesh with NaN or infinity");
    result.push_back((linear * value.cast<double>()).cast<float>());
  }
  return result;
}

void add_mesh(const bake::Mesh& mesh, const WorldConvention& world, BufferBuilder& buffer, tinygltf::Model& model) {
  tinygltf::Primitive primitive;
  const std::vector<Vec3f> positions = mapped(mesh.positions, gltf_from_world(world).linear);
  Aabbf box = Aabbf::empty();
  for (const Vec3f& p : positions) box.grow(p);
  const int position = buffer.add_vectors(positions);
  model.accessors[std::size_t(position)].minValues = {box.min.x, box.min.y, box.min.z};
  model.accessors[std::size_t(position)].maxValues = {box.max.x, box.max.y, box.max.z};
  primitive.attributes["POSITION"] = position;
  primitive.attributes["NORMAL"] = buffer.add_vectors(mapped(mesh.normals, turned_up(world.up_axis, "y").linear));
  const int uv_view =
      buffer.add_view(mesh.uvs.data(), mesh.uvs.size() * sizeof(bake::TextureCoordinate), TINYGLTF_TARGET_ARRAY_BUFFER);
  primitive.attributes["TEXCOORD_0"] =
      buffer.add_accessor(uv_view, mesh.uvs.size(), TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC2);
  const int index_view = buffer.add_view(mesh.triangles.data(), mesh.triangles.size() * sizeof(bake::Triangle),
                                         TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
  primitive.indices = buffer.add_accessor(index_view, 3 * mesh.triangles.size(), TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT,
                                          TINYGLTF_TYPE_SCALAR);
  primitive.material = 0;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  tinygltf::Mesh shape;
  shape.name = "cnerf mesh";
  shape.primitives = {primitive};
  model.meshes.push_back(shape);
}

/// Names of files that exist, by what they are.
nlohmann::json named_files(const GltfScene& scene) {
  nlohmann::json files = nlohmann::json::object();
  if (!scene.rgb_exr.empty()) files["rgb_exr"] = scene.rgb_exr;
  if (!scene.luminance_exr.empty()) files["luminance_exr"] = scene.luminance_exr;
  if (!scene.lab_exr.empty()) files["lab_exr"] = scene.lab_exr;
  return files;
}

void add_material(const GltfScene& scene, tinygltf::Model& model) {
  tinygltf::Material material;
  material.name = "cnerf baked colour";
  material.extensions["KHR_materials_unlit"] = tinygltf::Value(tinygltf::Value::Object{});
  material.pbrMetallicRoughness.metallicFactor = 0;  // for readers that do not know unlit
  material.pbrMetallicRoughness.roughnessFactor = 1;
  material.pbrMetallicRoughness.baseColorTexture.index = 0;
  nlohmann::json ours = named_files(scene);
  ours["color"] = color_origin_text(scene.label.provenance);
  material.extras = extras(ours);
  model.extensionsUsed = {"KHR_materials_unlit"};
  model.materials = {material};

  tinygltf::Sampler sampler;
  sampler.magFilter = TINYGLTF_TEXTURE_FILTER_LINEAR;
  sampler.minFilter = TINYGLTF_TEXTURE_FILTER_LINEAR_MIPMAP_LINEAR;
  sampler.wrapS = sampler.wrapT = TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE;
  model.samplers = {sampler};
  tinygltf::Texture texture;
  texture.sampler = 0;
  texture.source = 0;
  model.textures = {texture};
}

/// x, y, z, w of a rotation (Shepperd's method: divides by the largest of the four).
std::vector<double> quaternion_of(const Mat3d& m) {
  const double xx = m.rows[0].x, yy = m.rows[1].y, zz = m.rows[2].z;
  const double squares[4] = {1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz};  // 4 q^2
  const auto largest = std::max_element(squares, squares + 4) - squares;
  const double s = 2 * std::sqrt(squares[largest]);  // 4 q
  const double yx = m.rows[1].x, xy = m.rows[0].y, zx = m.rows[2].x, xz = m.rows[0].z, zy = m.rows[2].y,
               yz = m.rows[1].z;
  if (largest == 0) return {s / 4, (xy + yx) / s, (xz + zx) / s, (zy - yz) / s};
  if (largest == 1) return {(xy + yx) / s, s / 4, (yz + zy) / s, (xz - zx) / s};
  if (largest == 2) return {(xz + zx) / s, (yz + zy) / s, s / 4, (yx - xy) / s};
  return {(zy - yz) / s, (xz - zx) / s, (yx - xy) / s, s / 4};
}

/// Intrinsics that glTF knows; cameras that share them share an entry.
int camera_index(const Intrinsics& lens, double near, double far, tinygltf::Model& model) {
  tinygltf::Camera camera;
  camera.type = "perspective";
  camera.perspective.aspectRatio = (lens.width / lens.fx) / (lens.height / lens.fy);
  camera.perspective.yfov = 2 * std::atan(0.5 * lens.height / lens.fy);
  camera.perspective.znear = near;
  camera.perspective.zfar = far;
  const nlohmann::json intrinsics{
      {"width", lens.width}, {"height", lens.height},        {"fx", lens.fx}, {"fy", lens.fy}, {"cx", lens.cx},
      {"cy", lens.cy},       {"distortion", lens.distortion}};
  camera.extras = extras(intrinsics);
  for (std::size_t c = 0; c < model.cameras.size(); ++c) {
    if (model.cameras[c] == camera) return int(c);
  }
  model.cameras.push_back(camera);
  return int(model.cameras.size()) - 1;
}

/// Node of a camera: glTF's look along -Z with +Y up, ours along +Z with +Y down.
/// @param shown  the mesh's box, world
void add_cameras(const std::vector<bake::Camera>& cameras, const WorldConvention& world, const Aabbd& shown,
                 tinygltf::Model& model) {
  const Mat3d upright = turned_up(world.up_axis, "y").linear, opencv_from_gltf{{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};
  const double size = length(shown.size());
  double farthest = size;
  for (const bake::Camera& camera : cameras) {
    farthest = std::max(farthest, length(camera.world_from_camera.translation - shown.centre()) + size);
  }
  const double near = 1e-3 * size * world.metres_per_unit, far = 4 * farthest * world.metres_per_unit;
  for (const bake::Camera& camera : cameras) {
    const auto& [linear, centre] = camera.world_from_camera;
    const Vec3d place = gltf_from_world(world).point(centre);
    tinygltf::Node node;
    node.name = camera.name;
    node.camera = camera_index(camera.intrinsics, near, far, model);
    node.rotation = quaternion_of(upright * linear * opencv_from_gltf);
    node.translation = {place.x, place.y, place.z};
    model.scenes[0].nodes.push_back(int(model.nodes.size()));
    model.nodes.push_back(node);
  }
}

Aabbd box_of(const bake::Mesh& mesh) {
  Aabbd box = Aabbd::empty();
  for (const Vec3f& p : mesh.positions) box.grow(p.cast<double>());
  return box;
}

/// Everything but the image.
tinygltf::Model model_of(const bake::Mesh& mesh, const GltfScene& scene) {
  const WorldConvention& world = scene.label.world;
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "cnerf " CNERF_VERSION;
  model.asset.extras = extras({{"color", color_origin_text(scene.label.provenance)},
                               {"units_of_the_poses", world.units},
                               {"up_axis_of_the_poses", world.up_axis},
                               {"colorizer", scene.label.provenance.colorizer},
                               {"take", scene.label.provenance.take}});
  BufferBuilder buffer(model);
  add_mesh(mesh, world, buffer, model);
  add_material(scene, model);
  tinygltf::Node shown;
  shown.name = "cnerf mesh";
  shown.mesh = 0;
  if (!scene.vdb.empty()) shown.extras = extras({{"vdb", scene.vdb}});
  model.nodes.push_back(shown);
  model.scenes.assign(1, {});
  model.scenes[0].nodes = {0};
  if (!scene.sky.empty()) model.scenes[0].extras = extras({{"sky", scene.sky}});
  model.defaultScene = 0;
  add_cameras(scene.cameras, world, box_of(mesh), model);
  return model;
}

std::string serialized(const tinygltf::Model& model, bool binary) {
  tinygltf::TinyGLTF writer;
  writer.SetImageWriter(nullptr, nullptr);  // pixels are encoded already
  std::ostringstream stream;
  CNERF_CHECK(writer.WriteGltfSceneToStream(&model, stream, /*prettyPrint=*/true, binary), "tinygltf failed");
  return stream.str();
}

/// With the PNG as a piece of its one buffer.
std::string glb_of(tinygltf::Model model, const GltfScene& scene) {
  tinygltf::Image image;
  image.mimeType = "image/png";
  image.bufferView = BufferBuilder(model).add_view(scene.basecolor_png.data(), scene.basecolor_png.size(), 0);
  model.images = {image};
  return serialized(model, true);
}

/// JSON that names its buffer and picture. tinygltf would write the buffer into it, as text.
std::string gltf_of(tinygltf::Model model, const std::string& buffer_name, const std::string& image_name) {
  const std::size_t bytes = model.buffers[0].data.size();
  model.buffers[0].data.clear();
  tinygltf::Image image;
  image.uri = image_name;
  model.images = {image};
  nlohmann::json json = nlohmann::json::parse(serialized(model, false));
  json["buffers"] = nlohmann::json::array({{{"uri", buffer_name}, {"byteLength", bytes}}});
  return json.dump(2) + "\n";
}

}  // namespace

Affined gltf_from_world(const WorldConvention& world) {
  return {turned_up(world.up_axis, "y").linear * world.metres_per_unit, {}};
}

GltfFiles write_gltf(const bake::Mesh& mesh, const GltfScene& scene, const std::filesystem::path& folder,
                     const std::string& name) {
  CNERF_CHECK(!mesh.triangles.empty(), "an empty mesh cannot be written");
  CNERF_CHECK_EQ(mesh.normals.size(), mesh.positions.size());
  CNERF_CHECK_EQ(mesh.uvs.size(), mesh.positions.size());
  GltfFiles files{folder / (name + ".gltf"), folder / (name + ".bin"), folder / (name + "_basecolor.png"),
                  folder / (name + ".glb")};
  const tinygltf::Model model = model_of(mesh, scene);
  write_file(files.glb, glb_of(model, scene));
  write_file(files.basecolor, scene.basecolor_png);
  write_file(files.buffer, std::as_bytes(std::span(model.buffers[0].data)));
  write_file(files.gltf, gltf_of(model, files.buffer.filename().string(), files.basecolor.filename().string()));
  return files;
}

}  // namespace cnerf::exporting
