/// Captures of phones: the raw data of Polycam, and Record3D's export of pictures. Both have poses of ARKit, whose
/// cameras look along -Z with +Y up; Y of the world is up.
///
/// Facts: nerfstudio's process_data/polycam_utils.py and record3d_utils.py; for Record3D also its author's answers
/// (github.com/marek-simonik/record3d, issues 27, 36 and 83): poses are world_from_camera as a quaternion x y z w and a
/// position; K, column by column, is that of the first picture, `perFrameIntrinsicCoeffs` are fx fy cx cy of each.

#include <fmt/format.h>

#include <array>

#include "src/base/error.h"
#include "src/base/json_record.h"
#include "src/capture/camera_record.h"
#include "src/capture/listing.h"
#include "src/capture/pose.h"
#include "src/capture/stated_values.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

/// A .json of Polycam; a number of any kind may be written with a point.
struct PolycamCamera {
  double width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<std::array<double, 4>, 3> t{};  ///< rows of world_from_camera

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    LensRecord::visit(self, v);
    constexpr const char* kNames[3][4] = {
        {"t_00", "t_01", "t_02", "t_03"}, {"t_10", "t_11", "t_12", "t_13"}, {"t_20", "t_21", "t_22", "t_23"}};
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t column = 0; column < 4; ++column) v(kNames[row][column], self.t[row][column]);
    }
  }
};

struct Record3dMetadata {
  double w = 0, h = 0;
  std::array<double, 9> k{};                                 ///< column by column
  std::vector<std::array<double, 7>> poses;                  ///< quaternion x y z w, position
  std::optional<std::vector<std::array<double, 4>>> lenses;  ///< fx fy cx cy of each picture

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("w", self.w);
    v("h", self.h);
    v("K", self.k);
    v("poses", self.poses);
    v("perFrameIntrinsicCoeffs", self.lenses);
  }
};

Affined pose_of(const PolycamCamera& camera) {
  Affined pose;
  for (int r = 0; r < 3; ++r) {
    const std::array<double, 4>& row = camera.t[std::size_t(r)];
    pose.linear.rows[r] = {row[0], row[1], row[2]};
    pose.translation[r] = row[3];
  }
  return opencv_from_opengl_camera(pose);
}

/// The folder of images that belongs to one of cameras.
fs::path images_of(const fs::path& cameras_folder) {
  const bool corrected = cameras_folder.filename() == "corrected_cameras";
  return cameras_folder.parent_path() / (corrected ? "corrected_images" : "images");
}

/// By what the pictures of a recording are numbered, from 0.
fs::path record3d_image(const fs::path& folder, std::size_t index) {
  fs::path image;
  for (const char* name : {"rgb", "rgbd"}) {
    image = named_image(folder / name, std::to_string(index));
    if (image.has_extension()) return image;  // it is there
  }
  return folder / "rgb" / (std::to_string(index) + ".jpg");
}

}  // namespace

std::optional<fs::path> find_polycam_cameras(const fs::path& root) {
  for (const char* name : {"corrected_cameras", "cameras"}) {
    const fs::path folder = root / "keyframes" / name;
    if (!files_with_extension(folder, ".json").empty()) return folder;
  }
  return std::nullopt;
}

CaptureListing read_polycam(const fs::path& cameras_folder) {
  CaptureListing listing;
  listing.source = cameras_folder;
  listing.format = "polycam";
  for (const fs::path& file : files_with_extension(cameras_folder, ".json")) {
    const auto camera = read_record<PolycamCamera>(file);
    ListedView view;
    view.name = file.stem().string();
    view.field = "camera";
    view.poses_file = file;
    view.image_file = named_image(images_of(cameras_folder), view.name);
    view.intrinsics.width = side_of_image(camera.width, file, "width");
    view.intrinsics.height = side_of_image(camera.height, file, "height");
    view.intrinsics.fx = above_zero(camera.fx, file, "fx");
    view.intrinsics.fy = above_zero(camera.fy, file, "fy");
    view.intrinsics.cx = camera.cx;
    view.intrinsics.cy = camera.cy;
    view.world_from_camera = pose_of(camera);
    listing.views.push_back(std::move(view));
  }
  make_poses_rigid(listing, "t_00 to t_22");
  return listing;
}

std::optional<fs::path> find_record3d_metadata(const fs::path& root) {
  for (const fs::path& folder : {root, root / "EXR_RGBD"}) {
    const bool has_images = fs::is_directory(folder / "rgb") || fs::is_directory(folder / "rgbd");
    if (has_images && fs::is_regular_file(folder / "metadata.json")) return folder / "metadata.json";
    if (has_images && fs::is_regular_file(folder / "metadata")) return folder / "metadata";  // an unpacked .r3d
  }
  return std::nullopt;
}

CaptureListing read_record3d(const fs::path& json_file) {
  const auto metadata = read_record<Record3dMetadata>(json_file);
  const bool has_lenses = metadata.lenses && !metadata.lenses->empty();
  if (has_lenses && metadata.lenses->size() != metadata.poses.size()) {
    throw InputError(
        json_file, "perFrameIntrinsicCoeffs",
        fmt::format("expected one for each of the {} poses, found {}", metadata.poses.size(), metadata.lenses->size()));
  }
  const std::array<double, 9>& k = metadata.k;
  CaptureListing listing;
  listing.source = json_file;
  listing.format = "record3d";
  for (std::size_t i = 0; i < metadata.poses.size(); ++i) {
    ListedView view;
    view.field = "poses[" + std::to_string(i) + "]";
    view.poses_file = json_file;
    view.image_file = record3d_image(json_file.parent_path(), i);
    view.name = view.image_file.filename().string();
    Intrinsics& out = view.intrinsics;
    out.width = side_of_image(metadata.w, json_file, "w");
    out.height = side_of_image(metadata.h, json_file, "h");
    const auto [fx, fy, cx, cy] = has_lenses ? (*metadata.lenses)[i] : std::array<double, 4>{k[0], k[4], k[6], k[7]};
    const std::string lens = has_lenses ? "perFrameIntrinsicCoeffs[" + std::to_string(i) + "]" : "K";
    out.fx = above_zero(fx, json_file, lens);
    out.fy = above_zero(fy, json_file, lens);
    out.cx = cx;
    out.cy = cy;
    const auto [qx, qy, qz, qw, x, y, z] = metadata.poses[i];
    view.world_from_camera =
        opencv_from_opengl_camera({rotation_from_quaternion(qw, qx, qy, qz, json_file, view.field), {x, y, z}});
    listing.views.push_back(std::move(view));
  }
  make_poses_rigid(listing, "");
  return listing;
}

}  // namespace cnerf
