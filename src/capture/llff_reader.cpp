/// LLFF's poses_bounds.npy (Mildenhall et al. 2019): N rows of a 3x5 matrix and two depths.

#include <algorithm>
#include <cmath>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/listing.h"
#include "src/capture/npy_reader.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t kColumns = 17;

/// A folder of images and by how much they were reduced.
struct ImageFolder {
  fs::path path;
  int reduced_by = 1;
};

std::vector<ImageFolder> find_image_folders(const fs::path& root) {
  std::vector<ImageFolder> folders;
  if (fs::is_directory(root / "images")) folders.push_back({root / "images", 1});
  for (int n = 2; n <= 64; ++n) {
    const fs::path folder = root / ("images_" + std::to_string(n));
    if (fs::is_directory(folder)) folders.push_back({folder, n});
  }
  return folders;
}

/// The folder reduced most without going below what was asked for; else the largest one there is.
ImageFolder choose_image_folder(const std::vector<ImageFolder>& folders, int downscale) {
  ImageFolder chosen = folders.front();
  for (const ImageFolder& folder : folders) {
    if (folder.reduced_by <= downscale) chosen = folder;
  }
  return chosen;
}

/// One row. Columns of the 3x3 part are the camera's down, right and back; the fifth column is height, width, focal.
ListedView list_view(const double* row, const fs::path& npy_file, std::size_t index) {
  const auto column = [&](std::size_t j) { return Vec3d{row[j], row[5 + j], row[10 + j]}; };
  ListedView view;
  view.field = "row " + std::to_string(index);
  view.poses_file = npy_file;
  view.world_from_camera = {Mat3d::from_columns(column(1), column(0), -column(2)), column(3)};
  const Vec3d size_and_focal = column(4);
  Intrinsics& intrinsics = view.intrinsics;
  const auto is_size = [](double v) { return v >= 1 && v <= 1e5; };
  if (!is_size(size_and_focal.x) || !is_size(size_and_focal.y) || !(size_and_focal.z > 0)) {
    throw InputError(npy_file, view.field,
                     "expected height, width and focal length, found " + std::to_string(size_and_focal.x) + ", " +
                         std::to_string(size_and_focal.y) + ", " + std::to_string(size_and_focal.z));
  }
  intrinsics.height = int(std::lround(size_and_focal.x));
  intrinsics.width = int(std::lround(size_and_focal.y));
  intrinsics.fx = intrinsics.fy = size_and_focal.z;
  intrinsics.cx = intrinsics.cy = kCentred;
  return view;
}

DepthRange depth_range_of(const NpyArray& array, const fs::path& npy_file) {
  DepthRange range = {INFINITY, 0};
  for (std::size_t i = 0; i < array.shape[0]; ++i) {
    const double near = array.values[i * kColumns + 15];
    const double far = array.values[i * kColumns + 16];
    if (!(near > 0 && far > near && std::isfinite(far))) {
      throw InputError(npy_file, "row " + std::to_string(i),
                       "expected 0 < near < far, found " + std::to_string(near) + ", " + std::to_string(far));
    }
    range.near = std::min(range.near, near);
    range.far = std::max(range.far, far);
  }
  return range;
}

NpyArray read_poses(const fs::path& npy_file) {
  NpyArray array = read_npy(npy_file);
  if (array.shape.size() != 2 || array.shape[1] != kColumns) {
    std::string shape;
    for (const std::size_t extent : array.shape) shape += (shape.empty() ? "" : "x") + std::to_string(extent);
    throw InputError(npy_file, "shape", "expected Nx17, found " + shape);
  }
  return array;
}

}  // namespace

CaptureListing read_llff(const fs::path& npy_file, int downscale) {
  const fs::path root = npy_file.parent_path();
  const NpyArray array = read_poses(npy_file);
  const std::vector<ImageFolder> folders = find_image_folders(root);
  if (folders.empty())
    throw MissingInputError((root / "images").string() + " (or images_4, images_8, …): no such folder");
  const ImageFolder folder = choose_image_folder(folders, downscale);
  const std::vector<fs::path> files = files_in(folder.path, is_image_file);
  if (files.size() != array.shape[0]) {
    throw InputError(npy_file, "shape",
                     "expected a row for each of the " + std::to_string(files.size()) + " images in " +
                         folder.path.string() + ", found " + std::to_string(array.shape[0]));
  }

  std::vector<fs::path> full_files;  // in the same order; names may differ
  if (folder.path != folders.front().path) full_files = files_in(folders.front().path, is_image_file);
  if (full_files.size() != files.size()) full_files.clear();

  CaptureListing listing;
  listing.source = npy_file;
  listing.format = "llff";
  for (std::size_t i = 0; i < files.size(); ++i) {
    ListedView view = list_view(&array.values[i * kColumns], npy_file, i);
    view.name = fs::relative(files[i], root.empty() ? "." : root).generic_string();
    view.image_file = files[i];
    if (!full_files.empty()) view.full_file = full_files[i];
    view.downscale = std::max(1.0, double(downscale) / folder.reduced_by);
    listing.views.push_back(std::move(view));
  }
  if (folder.reduced_by > downscale) {
    listing.notes.push_back("there are no images larger than those in " + folder.path.filename().string() +
                            ": the capture is read at 1/" + std::to_string(folder.reduced_by) + " size");
  }
  listing.notes.push_back(
      npy_file.filename().string() +
      " knows no lens: unless the pictures were undistorted, --set stage1.lenses=true may be better, or cameras "
      "that cnerf prepare estimates");
  make_poses_rigid(listing, "");
  listing.depth_range = depth_range_of(array, npy_file);
  return listing;
}

}  // namespace cnerf
