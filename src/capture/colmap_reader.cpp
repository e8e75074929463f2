/// COLMAP's sparse models: cameras, images and points3D, as .bin or as .txt (colmap, doc/format.rst).

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <sstream>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/byte_reader.h"
#include "src/capture/listing.h"
#include "src/capture/pose.h"
#include "src/capture/stated_values.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

/// What the parameters of a camera model are, in their order: 'f' one focal length, "xy" two, "c" both coordinates of
/// the principal point, then coefficients by their index in Intrinsics::distortion.
struct ModelLayout {
  const char* name;
  bool one_focal_length;
  LensModel lens;
  std::vector<std::size_t> coefficients;
};

/// Ordered by COLMAP's numbers; a nullptr name is a model that is not supported.
const std::array<ModelLayout, 10>& model_layouts() {
  static const std::array<ModelLayout, 10> layouts = {{
      {"SIMPLE_PINHOLE", true, LensModel::kPinhole, {}},
      {"PINHOLE", false, LensModel::kPinhole, {}},
      {"SIMPLE_RADIAL", true, LensModel::kOpenCv, {0}},
      {"RADIAL", true, LensModel::kOpenCv, {0, 1}},
      {"OPENCV", false, LensModel::kOpenCv, {0, 1, 2, 3}},
      {"OPENCV_FISHEYE", false, LensModel::kOpenCvFisheye, {0, 1, 2, 3}},
      {"FULL_OPENCV", false, LensModel::kOpenCv, {0, 1, 2, 3, 4, 5, 6, 7}},
      {nullptr, false, LensModel::kPinhole, {}},  // FOV
      {"SIMPLE_RADIAL_FISHEYE", true, LensModel::kOpenCvFisheye, {0}},
      {"RADIAL_FISHEYE", true, LensModel::kOpenCvFisheye, {0, 1}},
  }};
  return layouts;
}

const ModelLayout& layout_by_number(std::int32_t number, const fs::path& file, const std::string& field) {
  const auto& layouts = model_layouts();
  if (number < 0 || std::size_t(number) >= layouts.size() || layouts[std::size_t(number)].name == nullptr) {
    throw InputError(
        file, field,
        "expected a pinhole, radial, OpenCV or fisheye camera model, found number " + std::to_string(number));
  }
  return layouts[std::size_t(number)];
}

const ModelLayout& layout_by_name(const std::string& name, const fs::path& file, const std::string& field) {
  for (const ModelLayout& layout : model_layouts()) {
    if (layout.name != nullptr && name == layout.name) return layout;
  }
  throw InputError(file, field, "expected a pinhole, radial, OpenCV or fisheye camera model, found " + name);
}

/// Fills intrinsics from `next()`, which yields the parameters one by one.
template <typename Next>
Intrinsics read_parameters(const ModelLayout& layout, std::uint64_t width, std::uint64_t height, const fs::path& file,
                           const std::string& field, Next&& next) {
  if (width == 0 || height == 0 || width > 100000 || height > 100000) {
    throw InputError(file, field,
                     "expected an image size, found " + std::to_string(width) + "x" + std::to_string(height));
  }
  Intrinsics out;
  out.width = int(width);
  out.height = int(height);
  out.model = layout.lens;
  out.fx = above_zero(next(), file, field + ": focal length");
  out.fy = layout.one_focal_length ? out.fx : above_zero(next(), file, field + ": focal length");
  out.cx = next();
  out.cy = next();
  for (const std::size_t place : layout.coefficients) out.distortion[place] = next();
  return out;
}

using Cameras = std::map<std::uint32_t, Intrinsics>;

/// One registered image: COLMAP stores camera-from-world.
struct Registered {
  std::array<double, 4> quaternion{};  // w x y z
  Vec3d translation;
  std::uint32_t number = 0, camera = 0;
  std::string name;
};

constexpr std::int64_t kNoPoint = -1;  ///< number of what an observation without a point shows

// ---- binary -------------------------------------------------------------------------------------------------------

Cameras read_cameras_binary(const fs::path& file) {
  ByteReader in(file);
  Cameras cameras;
  const auto count = in.next<std::uint64_t>("number of cameras");
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string field = "camera " + std::to_string(i + 1) + " of " + std::to_string(count);
    const auto id = in.next<std::uint32_t>(field);
    const ModelLayout& layout = layout_by_number(in.next<std::int32_t>(field), file, field);
    const auto width = in.next<std::uint64_t>(field);
    const auto height = in.next<std::uint64_t>(field);
    cameras[id] = read_parameters(layout, width, height, file, field, [&] { return in.next<double>(field); });
  }
  return cameras;
}

/// @param seen  gets the observations of points; null: nobody asks for them
std::vector<Registered> read_images_binary(const fs::path& file, std::vector<ColmapObservation>* seen = nullptr) {
  ByteReader in(file);
  std::vector<Registered> images;
  const auto count = in.next<std::uint64_t>("number of images");
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string field = "image " + std::to_string(i + 1) + " of " + std::to_string(count);
    Registered image;
    image.number = in.next<std::uint32_t>(field);
    for (double& q : image.quaternion) q = in.next<double>(field);
    for (int axis = 0; axis < 3; ++axis) image.translation[axis] = in.next<double>(field);
    image.camera = in.next<std::uint32_t>(field);
    image.name = in.next_text(field);
    const auto observations = in.next<std::uint64_t>(field);
    constexpr std::size_t kObservation = 2 * sizeof(double) + sizeof(std::uint64_t);
    if (seen == nullptr) in.skip(observations, kObservation, field);
    for (std::uint64_t k = 0; seen != nullptr && k < observations; ++k) {
      const auto x = in.next<double>(field), y = in.next<double>(field);
      const auto point = in.next<std::int64_t>(field);
      if (point != kNoPoint) seen->push_back({image.name, x, y, point});
    }
    images.push_back(std::move(image));
  }
  return images;
}

std::vector<SparsePoint> read_points_binary(const fs::path& file) {
  ByteReader in(file);
  std::vector<SparsePoint> points;
  const auto count = in.next<std::uint64_t>("number of points");
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string field = "point " + std::to_string(i + 1) + " of " + std::to_string(count);
    in.next<std::uint64_t>(field);  // the point's own number
    SparsePoint point;
    for (int axis = 0; axis < 3; ++axis) point.position[axis] = in.next<double>(field);
    in.skip(3, 1, field);  // colour
    point.error = in.next<double>(field);
    const auto length = in.next<std::uint64_t>(field);
    for (std::uint64_t k = 0; k < length; ++k) {
      point.views.push_back(in.next<std::uint32_t>(field));
      in.next<std::uint32_t>(field);  // which of the image's observations
    }
    points.push_back(std::move(point));
  }
  return points;
}

// ---- text ---------------------------------------------------------------------------------------------------------

/// Lines of a text file with their numbers; comment lines are left out, empty ones are kept (they mean something).
struct Line {
  std::string text;
  std::string field;  ///< "line 12"
};
std::vector<Line> read_lines(const fs::path& file) {
  std::istringstream in(read_text_file(file));
  std::vector<Line> lines;
  std::string text;
  for (int number = 1; std::getline(in, text); ++number) {
    if (!text.empty() && text.back() == '\r') text.pop_back();
    if (!text.starts_with('#')) lines.push_back({text, "line " + std::to_string(number)});
  }
  return lines;
}

bool is_blank(const std::string& text) {
  return text.find_first_not_of(" \t") == std::string::npos;
}

template <typename T>
T parse(std::istringstream& in, const fs::path& file, const std::string& field) {
  T value{};
  if (!(in >> value))
    throw InputError(file, field, "expected a finite number or a name, found something else or nothing");
  return value;
}

Cameras read_cameras_text(const fs::path& file) {
  Cameras cameras;
  for (const Line& line : read_lines(file)) {
    if (is_blank(line.text)) continue;
    std::istringstream in(line.text);
    const auto id = parse<std::uint32_t>(in, file, line.field);
    const ModelLayout& layout = layout_by_name(parse<std::string>(in, file, line.field), file, line.field);
    const auto width = parse<std::uint64_t>(in, file, line.field);
    const auto height = parse<std::uint64_t>(in, file, line.field);
    cameras[id] =
        read_parameters(layout, width, height, file, line.field, [&] { return parse<double>(in, file, line.field); });
  }
  return cameras;
}

/// Two lines per image: pose and name, then its observations, which may be empty.
/// @param seen  as of read_images_binary
std::vector<Registered> read_images_text(const fs::path& file, std::vector<ColmapObservation>* seen = nullptr) {
  std::vector<Registered> images;
  const std::vector<Line> lines = read_lines(file);
  for (std::size_t i = 0; i < lines.size(); i += 2) {
    if (is_blank(lines[i].text)) {
      if (i + 2 >= lines.size()) break;  // blank lines at the end of the file
      throw InputError(file, lines[i].field, "expected a pose and a name, found an empty line");
    }
    std::istringstream in(lines[i].text);
    Registered image;
    image.number = parse<std::uint32_t>(in, file, lines[i].field);
    for (double& q : image.quaternion) q = parse<double>(in, file, lines[i].field);
    for (int axis = 0; axis < 3; ++axis) image.translation[axis] = parse<double>(in, file, lines[i].field);
    image.camera = parse<std::uint32_t>(in, file, lines[i].field);
    std::getline(in >> std::ws, image.name);  // a name may hold spaces
    if (image.name.empty()) throw InputError(file, lines[i].field, "expected an image name, found nothing");
    if (seen != nullptr && i + 1 < lines.size()) {
      std::istringstream numbers(lines[i + 1].text);
      ColmapObservation shown{image.name};
      while (numbers >> shown.x >> shown.y >> shown.point) {
        if (shown.point != kNoPoint) seen->push_back(shown);
      }
    }
    images.push_back(std::move(image));
  }
  return images;
}

/// Number, position, colour, error, and pairs of an image and one of its observations.
std::vector<SparsePoint> read_points_text(const fs::path& file) {
  std::vector<SparsePoint> points;
  for (const Line& line : read_lines(file)) {
    if (is_blank(line.text)) continue;
    std::istringstream in(line.text);
    parse<std::uint64_t>(in, file, line.field);
    SparsePoint point;
    for (int axis = 0; axis < 3; ++axis) point.position[axis] = parse<double>(in, file, line.field);
    double unused = 0;
    std::uint32_t image = 0, observation = 0;
    if (in >> unused >> unused >> unused >> point.error) {
      while (in >> image >> observation) point.views.push_back(image);
    }
    points.push_back(std::move(point));
  }
  return points;
}

// ---- model --------------------------------------------------------------------------------------------------------

/// A file of the model: binary if it is there, else text; nothing when neither is.
std::optional<fs::path> model_file(const fs::path& folder, const std::string& stem) {
  for (const char* extension : {".bin", ".txt"}) {
    if (fs::exists(folder / (stem + extension))) return folder / (stem + extension);
  }
  return std::nullopt;
}

fs::path required_model_file(const fs::path& folder, const std::string& stem) {
  const auto file = model_file(folder, stem);
  if (!file) throw MissingInputError((folder / stem).string() + ".bin or .txt: no such file");
  return *file;
}

std::vector<Registered> read_images(const fs::path& file, std::vector<ColmapObservation>* seen = nullptr) {
  return file.extension() == ".bin" ? read_images_binary(file, seen) : read_images_text(file, seen);
}

/// The folder that image names are relative to: `images` or `input` beside the model or above it.
fs::path find_image_folder(const fs::path& root, const fs::path& model_folder, const std::string& first_image) {
  std::vector<fs::path> places = {root, model_folder};
  fs::path above = fs::absolute(model_folder).lexically_normal();
  for (int level = 0; level < 3; ++level) places.push_back(above = above.parent_path());
  std::error_code failure;  // a name too long for the file system is of no file
  for (const fs::path& place : places) {
    for (const char* name : {"images", "input", "."}) {
      if (fs::exists(place / name / first_image, failure)) return (place / name).lexically_normal();
    }
  }
  for (const fs::path& place : places) {
    if (fs::is_directory(place / "images")) return place / "images";
  }
  return root / "images";
}

/// The files of a model.
struct ModelFiles {
  fs::path cameras, images;
};

ListedView list_view(const Registered& image, const Cameras& cameras, const ModelFiles& files,
                     const fs::path& image_folder) {
  ListedView view;
  view.name = image.name;
  view.number = image.number;
  view.field = "image " + image.name;
  view.poses_file = files.images;
  view.lens_file = files.cameras;
  view.image_file = image_folder / image.name;
  const auto camera = cameras.find(image.camera);
  if (camera == cameras.end()) {
    throw InputError(
        files.images, view.field,
        "expected a camera of " + files.cameras.string() + ", found number " + std::to_string(image.camera));
  }
  view.intrinsics = camera->second;
  const auto [w, x, y, z] = image.quaternion;
  const Affined camera_from_world = {rotation_from_quaternion(w, x, y, z, files.images, view.field), image.translation};
  view.world_from_camera = camera_from_world.inverse();
  return view;
}

}  // namespace

std::vector<SparsePoint> read_colmap_points(const fs::path& file) {
  std::vector<SparsePoint> points = file.extension() == ".bin" ? read_points_binary(file) : read_points_text(file);
  std::erase_if(points, [](const SparsePoint& point) {
    const auto [x, y, z] = point.position;
    return !std::isfinite(x) || !std::isfinite(y) || !std::isfinite(z) || !std::isfinite(point.error);
  });
  return points;
}

std::size_t colmap_image_count(const fs::path& model_folder) {
  const fs::path file = required_model_file(model_folder, "images");
  if (file.extension() == ".bin") return ByteReader(file).next<std::uint64_t>("number of images");
  return read_images_text(file).size();
}

std::vector<ColmapObservation> read_colmap_observations(const fs::path& model_folder) {
  std::vector<ColmapObservation> seen;
  (void)read_images(required_model_file(model_folder, "images"), &seen);
  return seen;
}

CaptureListing read_colmap(const fs::path& root, const fs::path& model_folder) {
  const fs::path cameras_file = required_model_file(model_folder, "cameras");
  const fs::path images_file = required_model_file(model_folder, "images");
  const Cameras cameras =
      cameras_file.extension() == ".bin" ? read_cameras_binary(cameras_file) : read_cameras_text(cameras_file);
  const std::vector<Registered> images = read_images(images_file);

  CaptureListing listing;
  listing.source = images_file;
  listing.format = "colmap";
  if (const auto points = model_file(model_folder, "points3D")) listing.points = read_colmap_points(*points);
  const fs::path folder = find_image_folder(root, model_folder, images.empty() ? "" : images.front().name);
  for (const Registered& image : images)
    listing.views.push_back(list_view(image, cameras, {cameras_file, images_file}, folder));
  make_poses_rigid(listing, "");
  return listing;
}

}  // namespace cnerf
