/// Cameras of RealityCapture and RealityScan: the table "Internal/External camera parameters" (.csv), and the sidecars
/// that "XMP export" puts beside images.
///
/// Facts:
///  * angles: Epic's "Registration export and camera orientations" (forums.unrealengine.com/t/682588). With all of them
///    0 the camera looks down with the picture's top to +Y (north); X is east, Z up; heading turns clockwise seen from
///    above. nerfstudio (process_data/realitycapture_utils.py) has the same product of rotations.
///  * sidecars: "RealityCapture XMP Camera Math" (support.capturingreality.com, 360017783459): Rotation is
///    camera_from_world by rows, in camera axes like those of camera.h, Position the camera's centre.
///  * lens: focal lengths are those of a picture whose longer side is 36 mm, principal points are offsets from the
///    centre in longer sides (AliceVision's importKnownPoses, nerfstudio). Distortion is Brown's, on x / z and y / z;
///    t1 is OpenCV's p2 and t2 its p1 (AliceVision, Camorph; nerfstudio takes them the other way).

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <sstream>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/image_io.h"
#include "src/capture/listing.h"
#include "src/capture/pose.h"
#include "src/capture/stated_values.h"
#include "src/capture/xml_element.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

/// A lens as both kinds of files state it.
struct StatedLens {
  double focal = 0;                    ///< millimetres, for a longer side of 36 mm
  double aspect = 1;                   ///< vertical over horizontal focal length
  double u = 0, v = 0;                 ///< principal point, longer sides from the centre
  std::array<double, 6> distortion{};  ///< k1 k2 k3 k4 t1 t2
};

/// Fills the intrinsics for the image as it is stored. Without it there is nothing to fill: the view will be left out.
void set_intrinsics(const StatedLens& lens, ListedView& view) {
  const auto [k1, k2, k3, k4, t1, t2] = lens.distortion;
  if (k4 != 0) {
    throw InputError(view.poses_file, view.field + ".distortion k4",
                     fmt::format("expected 0, found {:g}: no lens model here has it; align with Brown3", k4));
  }
  std::error_code failure;  // a name too long for the file system is of no file
  if (!fs::is_regular_file(view.image_file, failure)) return;
  const ImageHeader image = image_header(view.image_file);
  const double longer = std::max(image.width, image.height);
  Intrinsics& out = view.intrinsics;
  out.width = image.width;
  out.height = image.height;
  out.fx = above_zero(lens.focal, view.poses_file, view.field + ".focal length") / 36 * longer;
  out.fy = out.fx * above_zero(lens.aspect, view.poses_file, view.field + ".aspect ratio");
  out.cx = 0.5 * image.width + lens.u * longer;
  out.cy = 0.5 * image.height + lens.v * longer;
  out.distortion = {k1, k2, t2, t1, k3};
  out.model = out.distortion == std::array<double, 8>{} ? LensModel::kPinhole : LensModel::kOpenCv;
}

// ---- table ----------------------------------------------------------------------------------------------------------

std::vector<std::string> split_at_commas(std::string line) {
  if (!line.empty() && line.back() == '\r') line.pop_back();
  std::vector<std::string> cells(1);
  for (const char c : line) {
    if (c == ',') {
      cells.emplace_back();
    } else {
      cells.back() += c;
    }
  }
  return cells;
}

/// The names of the columns, if this is the first line of such a table.
std::vector<std::string> column_names(std::string line) {
  if (line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);
  if (!line.starts_with("#name,")) return {};
  return split_at_commas(line.substr(1));
}

/// A line of the table by the names of its columns.
class Row {
 public:
  Row(const std::vector<std::string>& names, const std::vector<std::string>& cells, const fs::path& file,
      std::string field)
      : file_(file), field_(std::move(field)) {
    if (cells.size() != names.size()) {
      throw InputError(file, field_, fmt::format("expected {} values, found {}", names.size(), cells.size()));
    }
    for (std::size_t i = 0; i < names.size(); ++i) cells_[names[i]] = cells[i];
  }
  [[nodiscard]] const std::string& text(const char* name) const {
    const auto cell = cells_.find(name);
    if (cell == cells_.end()) throw InputError(file_, "line 1", std::string("expected a column ") + name);
    return cell->second;
  }
  [[nodiscard]] double number(const char* name) const { return number_of(text(name), file_, field_ + "." + name); }
  [[nodiscard]] double number_if_there(const char* name) const { return cells_.contains(name) ? number(name) : 0; }

 private:
  const fs::path& file_;
  std::string field_;
  std::map<std::string, std::string> cells_;
};

enum class Axis { kX, kY, kZ };
/// A right-handed turn by so many degrees.
Mat3d turn(Axis axis, double degrees) {
  const double angle = degrees * std::numbers::pi / 180, c = std::cos(angle), s = std::sin(angle);
  switch (axis) {
    case Axis::kX:
      return {{{1, 0, 0}, {0, c, -s}, {0, s, c}}};
    case Axis::kY:
      return {{{c, 0, s}, {0, 1, 0}, {-s, 0, c}}};
    default:
      return {{{c, -s, 0}, {s, c, 0}, {0, 0, 1}}};
  }
}

/// Without turns the camera has the axes of the world: X right, Y to the picture's top, and it looks along -Z.
Affined pose_of(const Row& row) {
  const Mat3d rotation =
      turn(Axis::kZ, -row.number("heading")) * turn(Axis::kX, row.number("pitch")) * turn(Axis::kY, row.number("roll"));
  return opencv_from_opengl_camera({rotation, {row.number("x"), row.number("y"), row.number("alt")}});
}

ListedView list_row(const Row& row, const fs::path& file, std::string field) {
  ListedView view;
  view.name = row.text("name");
  view.field = std::move(field);
  view.poses_file = file;
  if (view.name.empty()) throw InputError(file, view.field + ".name", "expected a file name, found nothing");
  view.image_file = image_near_poses(file.parent_path(), view.name);
  view.world_from_camera = pose_of(row);
  StatedLens lens;
  lens.focal = row.number("f");
  lens.u = row.number_if_there("px");
  lens.v = row.number_if_there("py");
  constexpr std::array<const char*, 6> kNames = {"k1", "k2", "k3", "k4", "t1", "t2"};
  for (std::size_t i = 0; i < kNames.size(); ++i) lens.distortion[i] = row.number_if_there(kNames[i]);
  set_intrinsics(lens, view);
  return view;
}

// ---- sidecars -------------------------------------------------------------------------------------------------------

/// What a sidecar says of a camera: xcr:NAME is an attribute, or an element of its own.
class Sidecar {
 public:
  /// @throws InputError  where it is no XML.
  explicit Sidecar(const fs::path& file) : file_(file) {
    read_xml(file, document_);
    for (const pugi::xml_node node : document_.child("x:xmpmeta").child("rdf:RDF").children("rdf:Description")) {
      if (description_.empty() || !node.child("xcr:Rotation").empty() || node.attribute("xcr:Rotation")) {
        description_ = node;
      }
    }
  }
  [[nodiscard]] std::string text(const char* name) const {
    const std::string key = std::string("xcr:") + name;
    const pugi::xml_attribute attribute = description_.attribute(key.c_str());
    return attribute ? attribute.value() : description_.child_value(key.c_str());
  }
  [[nodiscard]] bool has_pose() const { return !text("Rotation").empty() && !text("Position").empty(); }
  [[nodiscard]] std::vector<double> numbers(const char* name, std::size_t count) const {
    return numbers_of(text(name), count, file_, std::string("xcr:") + name);
  }
  [[nodiscard]] double number(const char* name, double where_missing) const {
    return text(name).empty() ? where_missing : numbers(name, 1).front();
  }

 private:
  const fs::path& file_;
  pugi::xml_document document_;
  pugi::xml_node description_;
};

StatedLens lens_of(const Sidecar& sidecar, const fs::path& file) {
  StatedLens lens;
  lens.focal = sidecar.numbers("FocalLength35mm", 1).front();
  lens.aspect = sidecar.number("AspectRatio", 1);
  lens.u = sidecar.number("PrincipalPointU", 0);
  lens.v = sidecar.number("PrincipalPointV", 0);
  if (const double skew = sidecar.number("Skew", 0); skew != 0) {
    throw InputError(file, "xcr:Skew", fmt::format("expected 0, found {:g}", skew));
  }
  const std::string model = sidecar.text("DistortionModel");
  if (model.empty() || model == "perspective") return lens;
  if (model != "brown3" && model != "brown4" && model != "brown3t2" && model != "brown4t2") {
    throw InputError(file, "xcr:DistortionModel",
                     "expected perspective, brown3, brown4, brown3t2 or brown4t2, found " + model);
  }
  std::ranges::copy(sidecar.numbers("DistortionCoeficients", 6), lens.distortion.begin());  // spelt so
  return lens;
}

ListedView list_sidecar(const Sidecar& sidecar, const fs::path& file) {
  ListedView view;
  view.image_file = named_image(file.parent_path(), file.stem().string());
  view.name = view.image_file.filename().string();
  view.field = "xcr";
  view.poses_file = file;
  const Mat3d camera_from_world = matrix_of(sidecar.numbers("Rotation", 9));
  const std::vector<double> position = sidecar.numbers("Position", 3);
  view.world_from_camera = {camera_from_world.transposed(), {position[0], position[1], position[2]}};
  set_intrinsics(lens_of(sidecar, file), view);
  return view;
}

/// The beginning of a file, where it can be read.
std::string beginning_of(const fs::path& file) {
  std::string text(4096, '\0');
  std::ifstream in(file, std::ios::binary);
  in.read(text.data(), std::streamsize(text.size()));
  text.resize(std::size_t(in.gcount()));
  return text;
}

}  // namespace

std::optional<fs::path> find_realitycapture_table(const fs::path& root) {
  for (const fs::path& file : files_with_extension(root, ".csv")) {
    const std::string text = beginning_of(file);
    if (std::ranges::count(column_names(text.substr(0, text.find('\n'))), "heading") > 0) return file;
  }
  return std::nullopt;
}

std::optional<fs::path> find_realitycapture_sidecars(const fs::path& root) {
  for (const fs::path& folder : {root, root / "images"}) {
    for (const fs::path& file : files_with_extension(folder, ".xmp")) {
      if (beginning_of(file).find("capturingreality.com/ns/xcr") != std::string::npos) return folder;
    }
  }
  return std::nullopt;
}

CaptureListing read_realitycapture_table(const fs::path& csv_file) {
  std::istringstream in(read_text_file(csv_file));
  std::string line;
  std::getline(in, line);
  const std::vector<std::string> names = column_names(line);
  if (names.empty()) throw InputError(csv_file, "line 1", "expected #name,x,y,alt,heading,pitch,roll,f,...");
  CaptureListing listing;
  listing.source = csv_file;
  listing.format = "realitycapture";
  for (int number = 2; std::getline(in, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    const std::string field = "line " + std::to_string(number);
    listing.views.push_back(list_row(Row(names, split_at_commas(line), csv_file, field), csv_file, field));
  }
  make_poses_rigid(listing, "");
  return listing;
}

CaptureListing read_realitycapture_sidecars(const fs::path& folder) {
  CaptureListing listing;
  listing.source = folder;
  listing.format = "realitycapture";
  const std::vector<fs::path> files = files_with_extension(folder, ".xmp");
  for (const fs::path& file : files) {
    const Sidecar sidecar(file);
    if (sidecar.has_pose()) listing.views.push_back(list_sidecar(sidecar, file));
  }
  if (listing.views.size() < files.size()) {
    listing.notes.push_back(fmt::format("{} of {} sidecars state no pose, and their images were left out",
                                        files.size() - listing.views.size(), files.size()));
  }
  make_poses_rigid(listing, "Rotation");
  return listing;
}

}  // namespace cnerf
