/// transforms.json of NeRF (Blender synthetic), instant-ngp and nerfstudio.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string_view>

#include "src/base/error.h"
#include "src/base/json.h"
#include "src/capture/listing.h"
#include "src/capture/pose.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;

/// Looks fields up in a frame first, then in the whole file: every one of them may stand in either.
class Fields {
 public:
  Fields(const fs::path& file, const Json& top, const Json& frame, std::string prefix)
      : file_(file), top_(top), frame_(frame), prefix_(std::move(prefix)) {}

  [[nodiscard]] const Json* find(const char* key) const {
    if (const auto found = frame_.find(key); found != frame_.end() && !found->is_null()) return &*found;
    if (const auto found = top_.find(key); found != top_.end() && !found->is_null()) return &*found;
    return nullptr;
  }
  [[nodiscard]] double number(const char* key, double fallback) const {
    const Json* value = find(key);
    if (value == nullptr) return fallback;
    if (!value->is_number()) throw error(key, "expected a number, found " + excerpt(*value));
    return value->get<double>();
  }
  [[nodiscard]] int size(const char* key) const {
    const double value = number(key, 0);
    if (value < 0 || value > 1e5 || value != std::floor(value)) {
      throw error(key, "expected a size in pixels, found " + excerpt(*find(key)));
    }
    return int(value);
  }
  [[nodiscard]] std::string text(const char* key) const {
    const Json* value = find(key);
    if (value == nullptr) return "";
    if (!value->is_string()) throw error(key, "expected a text, found " + excerpt(*value));
    return value->get<std::string>();
  }
  [[nodiscard]] bool flag(const char* key) const {
    const Json* value = find(key);
    return value != nullptr && value->is_boolean() && value->get<bool>();
  }
  [[nodiscard]] InputError error(const char* key, const std::string& problem) const {
    const bool in_frame = frame_.contains(key);
    return {file_, in_frame ? prefix_ + "." + key : key, problem};
  }

 private:
  const fs::path& file_;
  const Json& top_;
  const Json& frame_;
  std::string prefix_;
};

bool has_distortion(const Fields& fields) {
  for (const char* key : {"k1", "k2", "k3", "k4", "p1", "p2"}) {
    if (fields.number(key, 0) != 0) return true;
  }
  return false;
}

/// Lens model and coefficients; the order of the coefficients is that of LensModel.
void read_lens(const Fields& fields, Intrinsics& out) {
  const std::string model = fields.text("camera_model");
  static const std::set<std::string> kBrown = {"",       "OPENCV",        "PINHOLE",    "SIMPLE_PINHOLE",
                                               "RADIAL", "SIMPLE_RADIAL", "PERSPECTIVE"};
  const bool fisheye = model == "OPENCV_FISHEYE" || fields.flag("is_fisheye");
  if (!fisheye && !kBrown.contains(model)) {
    throw fields.error("camera_model", "expected OPENCV, OPENCV_FISHEYE, PINHOLE or RADIAL, found " + model);
  }
  if (!has_distortion(fields)) {
    out.model = fisheye ? LensModel::kOpenCvFisheye : LensModel::kPinhole;
    return;
  }
  const auto k = [&](const char* key) { return fields.number(key, 0); };
  if (fisheye) {
    out.model = LensModel::kOpenCvFisheye;
    out.distortion = {k("k1"), k("k2"), k("k3"), k("k4")};
    return;
  }
  // In these files k4 is the next radial coefficient, in OpenCV the first of the denominator: neither is guessed.
  if (k("k4") != 0) throw fields.error("k4", "expected 0 for this camera model, found " + std::to_string(k("k4")));
  out.model = LensModel::kOpenCv;
  out.distortion = {k("k1"), k("k2"), k("p1"), k("p2"), k("k3")};
}

void read_intrinsics(const Fields& fields, ListedView& view) {
  Intrinsics& out = view.intrinsics;
  out.width = fields.size("w");
  out.height = fields.size("h");
  if ((out.width == 0) != (out.height == 0)) {
    throw fields.error(out.width == 0 ? "w" : "h", "expected both w and h, or neither");
  }
  out.fx = fields.number("fl_x", 0);
  out.fy = fields.number("fl_y", out.fx);
  if (out.fx == 0) out.fx = out.fy;
  out.cx = fields.number("cx", kCentred);
  out.cy = fields.number("cy", kCentred);
  view.angle_x = fields.number("camera_angle_x", 0);
  view.angle_y = fields.number("camera_angle_y", 0);
  if (out.fx == 0 && view.angle_x == 0 && view.angle_y == 0) {
    throw InputError(view.poses_file, view.field,
                     "expected a focal length (fl_x) or an angle of view (camera_angle_x), found neither");
  }
  read_lens(fields, out);
}

/// The number at a place of a matrix. Not-a-number is not JSON, so the parser has refused it already.
double entry(const Json& value, const fs::path& file, const std::string& field) {
  if (!value.is_number()) throw InputError(file, field, "expected numbers, found " + excerpt(value));
  return value.get<double>();
}

Affined read_matrix(const Json& frame, const fs::path& file, const std::string& prefix) {
  const std::string field = prefix + ".transform_matrix";
  const auto found = frame.find("transform_matrix");
  if (found == frame.end()) throw InputError(file, field, "expected 4x4 numbers, found nothing");
  const Json& rows = *found;
  const auto is_row = [](const Json& row) { return row.is_array() && row.size() == 4; };
  if (!rows.is_array() || rows.size() != 4 || !std::all_of(rows.begin(), rows.end(), is_row)) {
    const bool nested = rows.is_array() && !rows.empty() && rows[0].is_array();
    throw InputError(file, field,
                     "expected 4x4, got " + (nested ? std::to_string(rows.size()) + "x" + std::to_string(rows[0].size())
                                                    : std::string(rows.type_name())));
  }
  double m[4][4];
  for (std::size_t r = 0; r < 4; ++r) {
    for (std::size_t c = 0; c < 4; ++c) m[r][c] = entry(rows[r][c], file, field);
  }
  if (std::abs(m[3][0]) + std::abs(m[3][1]) + std::abs(m[3][2]) + std::abs(m[3][3] - 1) > 1e-6) {
    throw InputError(file, field, "expected a last row of 0 0 0 1, found " + excerpt(rows[3]));
  }
  Affined pose;
  for (int r = 0; r < 3; ++r) pose.linear.rows[r] = {m[r][0], m[r][1], m[r][2]};
  pose.translation = {m[0][3], m[1][3], m[2][3]};
  return pose;
}

ListedView read_frame(const fs::path& file, const Json& top, const Json& frame, std::size_t index) {
  ListedView view;
  view.field = "frames[" + std::to_string(index) + "]";
  view.poses_file = file;
  if (!frame.is_object())
    throw InputError(file, view.field, std::string("expected an object, found ") + frame.type_name());
  const Fields fields(file, top, frame, view.field);
  view.name = fields.text("file_path");
  if (view.name.empty()) throw InputError(file, view.field + ".file_path", "expected a file name, found nothing");
  view.image_file = named_image(file.parent_path(), view.name);
  if (const std::string mask = fields.text("mask_path"); !mask.empty()) {
    view.mask_file = named_image(file.parent_path(), mask);
  }
  view.world_from_camera = opencv_from_opengl_camera(read_matrix(frame, file, view.field));
  read_intrinsics(fields, view);
  view.exposure = fields.number("exposure", 1);
  if (!(view.exposure > 0)) {
    throw fields.error("exposure", "expected a number above 0, found " + excerpt(*fields.find("exposure")));
  }
  view.haze = fields.number("haze", 0);
  if (!(view.haze >= 0 && view.haze < 1)) {
    throw fields.error("haze", "expected a number from 0 to below 1, found " + excerpt(*fields.find("haze")));
  }
  return view;
}

std::vector<ListedView> read_frames(const fs::path& file, const Json& top) {
  const auto frames = top.find("frames");
  if (frames == top.end() || !frames->is_array()) {
    throw InputError(
        file, "frames",
        "expected a list of frames, found " + std::string(frames == top.end() ? "nothing" : frames->type_name()));
  }
  std::vector<ListedView> views;
  for (std::size_t i = 0; i < frames->size(); ++i) views.push_back(read_frame(file, top, (*frames)[i], i));
  return views;
}

std::string comparable(const std::string& name) {
  return fs::path(name).lexically_normal().generic_string();
}

/// Names of `train_filenames` and its kin, all of which are frames; empty when the list is not there.
std::set<std::string> filename_list(const fs::path& file, const Json& top, const char* key,
                                    const std::set<std::string>& frames) {
  std::set<std::string> names;
  const auto list = top.find(key);
  if (list == top.end() || list->is_null()) return names;
  if (!list->is_array()) throw InputError(file, key, std::string("expected a list, found ") + list->type_name());
  for (const Json& name : *list) {
    if (!name.is_string()) throw InputError(file, key, "expected file names, found " + excerpt(name));
    const std::string frame = comparable(name.get<std::string>());
    // A held-out view under another name would be learned from.
    if (!frames.contains(frame)) throw InputError(file, key, "expected file names of frames, found " + excerpt(name));
    names.insert(frame);
  }
  return names;
}

/// nerfstudio's split. Test views (validation views where no test is named) are held out; with an explicit training
/// list, views of no list are left out.
void apply_split_lists(const fs::path& file, const Json& top, CaptureListing& listing) {
  std::set<std::string> frames;
  for (const ListedView& view : listing.views) frames.insert(comparable(view.name));
  const auto list = [&](const char* key) { return filename_list(file, top, key, frames); };
  const std::set<std::string> train = list("train_filenames");
  std::set<std::string> held_out = list("test_filenames");
  if (held_out.empty()) held_out = list("val_filenames");
  const auto is_unused = [&](ListedView& view) {
    const std::string name = comparable(view.name);
    view.held_out = held_out.contains(name);
    return !view.held_out && !train.empty() && !train.contains(name);
  };
  const std::size_t unused = std::erase_if(listing.views, is_unused);
  if (unused > 0) {
    listing.notes.push_back(std::to_string(unused) + " frames are in neither the training nor the test list of " +
                            file.filename().string() + " and were left out");
  }
}

std::optional<Aabbd> read_bounds(const fs::path& file, const Json& top) {
  const auto box = top.find("aabb");
  if (box == top.end() || box->is_null()) return std::nullopt;
  const auto is_corner = [](const Json& corner) { return corner.is_array() && corner.size() == 3; };
  if (!box->is_array() || box->size() != 2 || !is_corner((*box)[0]) || !is_corner((*box)[1])) {
    throw InputError(file, "aabb", "expected [[x, y, z], [x, y, z]], found " + excerpt(*box));
  }
  Aabbd bounds;
  for (int axis = 0; axis < 3; ++axis) {
    bounds.min[axis] = entry((*box)[0][std::size_t(axis)], file, "aabb");
    bounds.max[axis] = entry((*box)[1][std::size_t(axis)], file, "aabb");
    if (!(-kFarthest <= bounds.min[axis] && bounds.min[axis] < bounds.max[axis] && bounds.max[axis] <= kFarthest)) {
      throw InputError(file, "aabb",
                       fmt::format("expected min < max within +-{:g}, found {}", kFarthest, excerpt(*box)));
    }
  }
  return bounds;
}

/// Our own key, written for captures whose cameras all look one way.
std::optional<DepthRange> read_depth_range(const fs::path& file, const Json& top) {
  const auto range = top.find("depth_range");
  if (range == top.end() || range->is_null()) return std::nullopt;
  if (!range->is_array() || range->size() != 2) {
    throw InputError(file, "depth_range", "expected [near, far], found " + excerpt(*range));
  }
  const DepthRange out = {entry((*range)[0], file, "depth_range"), entry((*range)[1], file, "depth_range")};
  if (!(out.near > 0 && out.near < out.far && out.far <= kFarthest)) {
    throw InputError(file, "depth_range",
                     fmt::format("expected 0 < near < far <= {:g}, found {}", kFarthest, excerpt(*range)));
  }
  return out;
}

void read_hints(const fs::path& file, const Json& top, CaptureListing& listing) {
  const Json no_frame = Json::object();
  const Fields fields(file, top, no_frame, "");
  listing.bounds = read_bounds(file, top);
  listing.depth_range = read_depth_range(file, top);
  if (fields.find("applied_transform") != nullptr) {
    listing.notes.emplace_back("the poses carry an applied_transform; results are in the frame of the file, after it");
  }
}

/// Our own key, which `cnerf prepare` writes: a file of COLMAP's points, whose images are numbers of frames.
std::vector<SparsePoint> read_sparse_points(const fs::path& file, const Json& top) {
  const Json no_frame = Json::object();
  const std::string name = Fields(file, top, no_frame, "").text("sparse_points");
  return name.empty() ? std::vector<SparsePoint>() : read_colmap_points(file.parent_path() / name);
}

/// Appends the frames of one file.
Json append_file(const fs::path& file, bool held_out, CaptureListing& listing) {
  Json top = read_json(file);
  if (!top.is_object()) throw InputError(file, "", std::string("expected an object, found ") + top.type_name());
  for (ListedView& view : read_frames(file, top)) {
    view.held_out = held_out;
    view.number = std::uint32_t(listing.views.size());
    listing.views.push_back(std::move(view));
  }
  return top;
}

}  // namespace

CaptureListing read_transforms(const fs::path& json_file) {
  CaptureListing listing;
  listing.source = json_file;
  listing.format = "transforms";
  const Json top = append_file(json_file, false, listing);
  read_hints(json_file, top, listing);
  listing.points = read_sparse_points(json_file, top);
  if (json_file.filename() == "transforms_train.json") {
    const fs::path test = json_file.parent_path() / "transforms_test.json";
    const fs::path validation = json_file.parent_path() / "transforms_val.json";
    if (fs::exists(test)) {
      append_file(test, true, listing);
      if (fs::exists(validation)) listing.notes.emplace_back("transforms_val.json is not used: there is a test split");
    } else if (fs::exists(validation)) {
      append_file(validation, true, listing);
    }
  } else {
    apply_split_lists(json_file, top, listing);
  }
  make_poses_rigid(listing, "transform_matrix");
  return listing;
}

}  // namespace cnerf
