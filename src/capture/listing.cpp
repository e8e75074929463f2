#include "src/capture/listing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include "src/base/files.h"
#include "src/capture/image_header.h"
#include "src/capture/pose.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

bool is_there(const fs::path& file) {
  std::error_code failure;  // a name too long for the file system is of no file
  return fs::exists(file, failure);
}

}  // namespace

void make_poses_rigid(CaptureListing& listing, const std::string& matrix_name) {
  double worst = 0;
  std::size_t repaired = 0;
  for (ListedView& view : listing.views) {
    const double error = orthonormality_error(view.world_from_camera.linear);
    view.world_from_camera = rigid_pose(view.world_from_camera, view.poses_file,
                                        view.field + (matrix_name.empty() ? "" : "." + matrix_name));
    worst = std::max(worst, error);
    repaired += error > kNotedPoseError ? 1 : 0;
  }
  if (repaired == 0) return;
  std::ostringstream note;
  note << repaired << " of " << listing.views.size() << " poses were not quite rotations (off by up to " << worst
       << ") and were replaced by the nearest one";
  listing.notes.push_back(note.str());
}

void bring_near_origin(CaptureListing& listing) {
  constexpr double kFar = 1e5, kNowhere = 1e8;  // units of the poses; beyond that it is no place at all
  if (listing.views.empty()) return;
  const Vec3d first = listing.views.front().world_from_camera.translation;
  if (!(length(first) >= kFar && length(first) < kNowhere)) return;
  const Vec3d origin = {std::round(first.x), std::round(first.y), std::round(first.z)};
  for (ListedView& view : listing.views) {
    view.world_from_camera.translation = view.world_from_camera.translation - origin;
  }
  for (SparsePoint& point : listing.points) point.position = point.position - origin;
  if (listing.bounds) listing.bounds = Aabbd{listing.bounds->min - origin, listing.bounds->max - origin};
  listing.notes.push_back(
      fmt::format("the poses are far from their origin: positions are relative to {:.0f} {:.0f} {:.0f}", origin.x,
                  origin.y, origin.z));
}

std::optional<fs::path> reduced_copy(const fs::path& image_file, int downscale) {
  const fs::path folder = image_file.parent_path();
  const fs::path sibling = folder.parent_path() / (folder.filename().string() + "_" + std::to_string(downscale));
  std::error_code failure;  // a name too long for the file system is of no file
  if (fs::exists(sibling / image_file.filename(), failure)) return sibling / image_file.filename();
  // LLFF and Mip-NeRF 360 reduce IMG_1.JPG to IMG_1.png.
  for (const std::string& extension : image_extensions()) {
    const fs::path other = sibling / (image_file.stem().string() + extension);
    if (fs::exists(other, failure)) return other;
  }
  return std::nullopt;
}

fs::path named_image(const fs::path& folder, std::string name) {
  std::ranges::replace(name, '\\', '/');
  fs::path plain = (folder / name).lexically_normal();
  if (is_there(plain)) return plain;
  for (const std::string& extension : image_extensions()) {
    fs::path with_extension = plain;
    with_extension += extension;
    if (is_there(with_extension)) return with_extension;
  }
  return plain;
}

fs::path image_near_poses(const fs::path& folder, const std::string& name) {
  fs::path beside = named_image(folder, name);
  fs::path below = named_image(folder / "images", name);
  return is_there(below) && !is_there(beside) ? below : beside;
}

std::vector<fs::path> files_with_extension(const fs::path& folder, const std::string& extension) {
  if (!fs::is_directory(folder)) return {};
  return files_in(folder, [&](const fs::path& file) { return lower_extension(file) == extension; });
}

const std::vector<std::string>& image_extensions() {
  static const std::vector<std::string> extensions = {".png", ".jpg",  ".jpeg", ".JPG", ".JPEG", ".PNG", ".exr",
                                                      ".tif", ".tiff", ".webp", ".TIF", ".TIFF", ".EXR", ".WEBP"};
  return extensions;
}

bool is_image_file(const fs::path& file) {
  return std::ranges::count(image_extensions(), lower_extension(file)) > 0;
}

std::vector<SparsePoint> points_by_place(const CaptureListing& listing) {
  std::map<std::uint32_t, std::uint32_t> places;
  for (std::uint32_t i = 0; i < listing.views.size(); ++i) places[listing.views[i].number] = i;
  std::vector<SparsePoint> points = listing.points;
  for (SparsePoint& point : points) {
    std::set<std::uint32_t> seen_by;
    for (const std::uint32_t number : point.views) {
      if (const auto place = places.find(number); place != places.end()) seen_by.insert(place->second);
    }
    point.views.assign(seen_by.begin(), seen_by.end());
  }
  return points;
}

}  // namespace cnerf
