/// cameras.xml, which Agisoft Metashape writes by "Export Cameras".
///
/// Facts: the appendix "Camera models" of the Metashape Professional manual gives, for frame cameras,
///   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + p1 (r^2 + 2 x^2) + 2 p2 x y,  y' with p1 and p2 exchanged,
///   u = width / 2 + cx + x' f + x' b1 + y' b2,  v = height / 2 + cy + y' f,
/// in camera axes like those of camera.h, so that its p1 is OpenCV's p2; for equidistant fisheyes x and y are first
/// scaled by angle / tangent. The layout is that which nerfstudio reads (process_data/metashape_utils.py): <transform>
/// of a camera is the 4x4 matrix chunk_from_camera; that of a chunk or component leads from there to the world.

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <set>

#include "src/base/error.h"
#include "src/capture/listing.h"
#include "src/capture/stated_values.h"
#include "src/capture/xml_element.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

/// world = scale * rotation * chunk + translation
struct WorldFromChunk {
  Mat3d rotation = Mat3d::identity();
  Vec3d translation;
  double scale = 1;
};

/// The most that the shear of a pixel grid may shift the image's border to be left out, pixels.
constexpr double kLargestShear = 0.5;

void expect_zero(const XmlElement& calibration, const char* name, const char* remedy) {
  const double value = calibration.number(name, 0);
  if (value == 0) return;
  throw InputError(*calibration.file, calibration.field + "." + name,
                   fmt::format("expected 0, found {:g}: {}", value, remedy));
}

void read_lens(const XmlElement& calibration, const std::string& type, Intrinsics& out) {
  const auto k = [&](const char* name) { return calibration.number(name, 0); };
  constexpr const char* kUndistort = "no lens model here has it; export undistorted photos or optimise without it";
  for (const char* name : {"p3", "p4"}) expect_zero(calibration, name, kUndistort);
  if (type == "frame") {
    expect_zero(calibration, "k4", kUndistort);
    out.distortion = {k("k1"), k("k2"), k("p2"), k("p1"), k("k3")};
    out.model = out.distortion == std::array<double, 8>{} ? LensModel::kPinhole : LensModel::kOpenCv;
  } else if (type == "fisheye" || type == "equidistant_fisheye") {
    for (const char* name : {"p1", "p2"}) expect_zero(calibration, name, kUndistort);
    out.distortion = {k("k1"), k("k2"), k("k3"), k("k4")};
    out.model = LensModel::kOpenCvFisheye;
  } else {
    throw InputError(*calibration.file, calibration.field + ".type",
                     "expected frame, fisheye or equidistant_fisheye, found " + type);
  }
}

/// The adjusted calibration of a sensor, else the first one, which may be what the user began with.
XmlElement calibration_of(const XmlElement& sensor) {
  XmlElement calibration = sensor.child("calibration");
  for (const pugi::xml_node other : sensor.node.children("calibration")) {
    if (std::string_view(other.attribute("class").value()) == "adjusted") calibration.node = other;
  }
  return calibration;
}

Intrinsics read_sensor(const XmlElement& sensor) {
  const XmlElement calibration = calibration_of(sensor);
  const XmlElement size = (calibration.has("resolution") ? calibration : sensor).child("resolution");
  const auto side = [&](const char* name) {
    const std::string field = size.field + "." + name;
    return side_of_image(number_of(size.node.attribute(name).value(), *size.file, field), *size.file, field);
  };
  Intrinsics out;
  out.width = side("width");
  out.height = side("height");
  out.fy = above_zero(calibration.number("f"), *sensor.file, calibration.field + ".f");
  out.fx = above_zero(out.fy + calibration.number("b1", 0), *sensor.file, calibration.field + ".b1");
  out.cx = 0.5 * out.width + calibration.number("cx", 0);
  out.cy = 0.5 * out.height + calibration.number("cy", 0);
  const double shear = calibration.number("b2", 0);
  if (!(std::abs(shear) * 0.5 * out.height <= kLargestShear * out.fy)) {
    expect_zero(calibration, "b2", "a sheared pixel grid is not supported; export undistorted photos");
  }
  const pugi::xml_attribute type = calibration.node.attribute("type");
  read_lens(calibration, (type ? type : sensor.node.attribute("type")).as_string("frame"), out);
  return out;
}

/// Identity where `owner`, a chunk or component, has no <transform>.
WorldFromChunk read_transform(const XmlElement& owner) {
  WorldFromChunk out;
  if (!owner.has("transform")) return out;
  const XmlElement transform = owner.child("transform");
  const auto numbers = [&](const char* name, std::size_t count) {
    const XmlElement element = transform.child(name);
    return numbers_of(element.node.child_value(), count, *element.file, element.field);
  };
  if (transform.has("rotation")) out.rotation = matrix_of(numbers("rotation", 9));
  if (transform.has("translation")) {
    const std::vector<double> t = numbers("translation", 3);
    out.translation = {t[0], t[1], t[2]};
  }
  out.scale = above_zero(transform.number("scale", 1), *owner.file, transform.field + ".scale");
  return out;
}

Affined read_pose(const XmlElement& camera, const WorldFromChunk& world_from_chunk) {
  const XmlElement transform = camera.child("transform");
  const std::vector<double> m = numbers_of(transform.node.child_value(), 16, *transform.file, transform.field);
  if (std::abs(m[12]) + std::abs(m[13]) + std::abs(m[14]) + std::abs(m[15] - 1) > 1e-6) {
    throw InputError(
        *transform.file, transform.field,
        fmt::format("expected a last row of 0 0 0 1, found {:g} {:g} {:g} {:g}", m[12], m[13], m[14], m[15]));
  }
  const Mat3d chunk_from_camera = {{{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}}};
  const Vec3d position = {m[3], m[7], m[11]};
  const auto& [rotation, translation, scale] = world_from_chunk;
  return {rotation * chunk_from_camera, rotation * position * scale + translation};
}

/// One chunk as it is read.
class Chunk {
 public:
  explicit Chunk(XmlElement chunk) : chunk_(std::move(chunk)), whole_(read_transform(chunk_)) {
    for (const pugi::xml_node sensor : chunk_.node.child("sensors").children("sensor")) {
      sensors_[sensor.attribute("id").value()] = sensor;
    }
    for (const pugi::xml_node node : chunk_.node.child("components").children("component")) {
      const std::string id = node.attribute("id").value();
      const XmlElement component = {node, chunk_.file, "component " + id};
      if (component.has("transform")) components_[id] = read_transform(component);
    }
  }

  /// Appends a camera that has a pose; others count.
  void add(const pugi::xml_node node, CaptureListing& listing) {
    const std::string label = node.attribute("label").value();
    const XmlElement camera = {node, chunk_.file, "camera " + label};
    ++cameras_;
    if (!camera.has("transform") || !node.attribute("enabled").as_bool(true)) return;
    if (label.empty()) {
      throw InputError(*chunk_.file, "camera " + std::string(node.attribute("id").value()) + ".label",
                       "expected a file name, found nothing");
    }
    ListedView view;
    view.name = label;
    view.field = camera.field;
    view.poses_file = *chunk_.file;
    view.image_file = image_near_poses(chunk_.file->parent_path(), label);
    view.intrinsics = sensor_of(camera);
    view.world_from_camera = read_pose(camera, transform_of(camera));
    listing.views.push_back(std::move(view));
  }

  /// What there is to say once all cameras were added.
  void finish(CaptureListing& listing) const {
    if (used_.size() > 1 && !std::ranges::all_of(used_, [&](const auto& id) { return components_.contains(id); })) {
      throw InputError(*chunk_.file, "components",
                       fmt::format("expected a transform of each, since cameras of {} components have poses, found {}; "
                                   "export one component",
                                   used_.size(), components_.size()));
    }
    if (listing.views.size() < cameras_) {
      listing.notes.push_back(fmt::format("{} of {} cameras have no pose in {}, or are disabled, and were left out",
                                          cameras_ - listing.views.size(), cameras_, chunk_.file->filename().string()));
    }
  }

 private:
  const Intrinsics& sensor_of(const XmlElement& camera) {
    const std::string id = camera.node.attribute("sensor_id").value();
    const auto sensor = sensors_.find(id);
    if (sensor == sensors_.end()) {
      throw InputError(*chunk_.file, camera.field + ".sensor_id", "expected the id of a sensor, found " + id);
    }
    const auto [read, is_new] = intrinsics_.try_emplace(id);
    if (is_new) read->second = read_sensor({sensor->second, chunk_.file, "sensor " + id});
    return read->second;
  }

  const WorldFromChunk& transform_of(const XmlElement& camera) {
    const std::string id = camera.node.attribute("component_id").value();
    used_.insert(id);
    const auto component = components_.find(id);
    return component == components_.end() ? whole_ : component->second;
  }

  XmlElement chunk_;
  WorldFromChunk whole_;
  std::map<std::string, pugi::xml_node> sensors_;
  std::map<std::string, Intrinsics> intrinsics_;      ///< of the sensors that cameras with poses name
  std::map<std::string, WorldFromChunk> components_;  ///< those that have a transform
  std::set<std::string> used_;                        ///< components of cameras with poses
  std::size_t cameras_ = 0;
};

/// Poses of a project that knows where on the Earth it is are geocentric: they are turned so that X is east, Y north
/// and Z up.
void turn_upright(CaptureListing& listing) {
  constexpr double kLeastRadius = 6.34e6,
                   kGreatestRadius = 6.40e6;  // of the Earth, from the deepest to the highest place
  constexpr double kFlattening = 1.0067395;   // of WGS 84: a squared over b squared, which leads from radii to normals
  if (listing.views.empty()) return;
  const Vec3d first = listing.views.front().world_from_camera.translation;
  if (length(first) < kLeastRadius || length(first) > kGreatestRadius) return;
  const Vec3d up = normalized(Vec3d{first.x, first.y, kFlattening * first.z});
  if (std::hypot(up.x, up.y) < 1e-6) return;  // at a pole nothing is east
  const Vec3d east = normalized(cross(Vec3d{0, 0, 1}, up));
  const Mat3d from_geocentric = {{east, cross(up, east), up}};
  for (ListedView& view : listing.views) {
    Affined& pose = view.world_from_camera;
    pose = {from_geocentric * pose.linear, from_geocentric * (pose.translation - first)};
  }
  listing.notes.push_back(fmt::format("the poses are geocentric: X is east, Y north and Z up of {:.0f} {:.0f} {:.0f}",
                                      first.x, first.y, first.z));
}

}  // namespace

CaptureListing read_metashape(const fs::path& xml_file) {
  pugi::xml_document document;
  read_xml(xml_file, document);
  const XmlElement top = {document.root(), &xml_file, ""};
  Chunk chunk(top.child("document").child("chunk"));
  const XmlElement cameras = top.child("document").child("chunk").child("cameras");

  CaptureListing listing;
  listing.source = xml_file;
  listing.format = "metashape";
  for (const pugi::xml_node node : cameras.node.children()) {
    const std::string_view kind = node.name();
    if (kind == "camera") chunk.add(node, listing);
    if (kind != "group") continue;  // groups hold cameras, and no groups
    for (const pugi::xml_node camera : node.children("camera")) chunk.add(camera, listing);
  }
  chunk.finish(listing);
  make_poses_rigid(listing, "transform");
  turn_upright(listing);
  return listing;
}

}  // namespace cnerf
