#include "export/camera_tracks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <string_view>

#include "export/up_axis.h"
#include "export/usd_text.h"
#include "export/vdb_writer.h"
#include "src/base/files.h"
#include "src/capture/picture_names.h"
#include "src/capture/pose.h"

namespace cnerf::exporting {
namespace {

constexpr double kApertureMm = 36;
constexpr int kMostDigits = 6;  // what is longer is a date rather than the number of a frame

bool is_digit(char c) {
  return std::isdigit(static_cast<unsigned char>(c)) != 0;
}

/// Whether a name ends with a date and a time, as telephones name pictures: "20240501_142233".
bool ends_with_time(std::string_view stem) {
  constexpr std::size_t kDate = 8, kAll = 15;
  if (stem.size() < kAll || (stem.size() > kAll && is_digit(stem[stem.size() - kAll - 1]))) return false;
  const std::string_view end = stem.substr(stem.size() - kAll);
  const bool are_digits =
      std::ranges::all_of(end.substr(0, kDate), is_digit) && std::ranges::all_of(end.substr(kDate + 1), is_digit);
  return are_digits && (end[kDate] == '_' || end[kDate] == '-') && (end.starts_with("19") || end.starts_with("20"));
}

/// The number that a picture's name ends with.
std::optional<int> number_at_end(const std::string& name) {
  const std::string stem = without_image_extension(name);
  if (ends_with_time(stem)) return std::nullopt;
  std::size_t begin = stem.size();
  while (begin > 0 && is_digit(stem[begin - 1])) --begin;
  if (begin == stem.size() || stem.size() - begin > kMostDigits) return std::nullopt;
  return std::stoi(stem.substr(begin));
}

/// OpenCV's axes to those of USD and Nuke: +X right, +Y up, looking along -Z.
Affined looking_backwards(const Affined& world_from_camera) {
  return opencv_from_opengl_camera(world_from_camera);  // which is its own inverse
}

/// USD applies matrices to row vectors.
std::string usd_matrix(const Affined& map) {
  std::string text = "(";
  for (int column = 0; column < 3; ++column) {
    const Vec3d v = map.linear.column(column);
    text += fmt::format(" ({}, {}, {}, 0),", v.x, v.y, v.z);
  }
  const Vec3d& t = map.translation;
  return text + fmt::format(" ({}, {}, {}, 1) )", t.x, t.y, t.z);
}

/// UsdGeomCamera has all of them in tenths of a unit of the scene.
struct UsdLens {
  double focal_length, horizontal_aperture, vertical_aperture, horizontal_offset, vertical_offset;
};

UsdLens usd_lens(const Intrinsics& lens, double metres_per_unit) {
  const double aperture = kApertureMm * 0.01 / metres_per_unit;
  const double focal = aperture * lens.fx / lens.width, vertical = focal * lens.height / lens.fy;
  const double right = 0.5 - lens.cx / lens.width, up = lens.cy / lens.height - 0.5;
  return {focal, aperture, vertical, aperture * right, vertical * up};
}

struct LensAttribute {
  const char* name;
  double UsdLens::*value;
};
constexpr std::array<LensAttribute, 5> kLensAttributes = {{{"focalLength", &UsdLens::focal_length},
                                                           {"horizontalAperture", &UsdLens::horizontal_aperture},
                                                           {"verticalAperture", &UsdLens::vertical_aperture},
                                                           {"horizontalApertureOffset", &UsdLens::horizontal_offset},
                                                           {"verticalApertureOffset", &UsdLens::vertical_offset}}};

/// A prim's name: letters, digits and `_`; each once.
std::string prim_name(const std::string& name, std::set<std::string>& taken) {
  std::string base = "camera_";
  for (const char c : std::filesystem::path(name).stem().string()) {
    base += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  }
  std::string unique = base;
  for (int i = 2; !taken.insert(unique).second; ++i) unique = base + "_" + std::to_string(i);
  return unique;
}

/// What all camera prims begin with.
std::string camera_begin(const std::string& name) {
  return fmt::format(
      "\n    def Camera \"{}\"\n    {{\n        token projection = \"perspective\"\n"
      "        float2 clippingRange = (0.001, 1000000)\n"
      "        uniform token[] xformOpOrder = [\"xformOp:transform\"]\n",
      name);
}

std::string still_camera(const bake::Camera& camera, const Affined& file_from_world, double metres_per_unit,
                         std::set<std::string>& taken) {
  std::string text = camera_begin(prim_name(camera.name, taken));
  text += "        custom string userProperties:view = " + usd_quoted(camera.name) + "\n";
  text += "        matrix4d xformOp:transform = " +
          usd_matrix(file_from_world * looking_backwards(camera.world_from_camera)) + "\n";
  const UsdLens lens = usd_lens(camera.intrinsics, metres_per_unit);
  for (const auto& [name, value] : kLensAttributes) text += fmt::format("        float {} = {}\n", name, lens.*value);
  return text + "    }\n";
}

std::string moving_camera(const std::vector<ShotFrame>& frames, const Affined& file_from_world,
                          double metres_per_unit) {
  std::string text = camera_begin("shot") + "        matrix4d xformOp:transform.timeSamples = {\n";
  for (const ShotFrame& frame : frames) {
    const Affined pose = file_from_world * looking_backwards(frame.camera->world_from_camera);
    text += fmt::format("            {}: {},\n", frame.number, usd_matrix(pose));
  }
  text += "        }\n";
  for (const auto& [name, value] : kLensAttributes) {
    text += fmt::format("        float {}.timeSamples = {{", name);
    for (const ShotFrame& frame : frames) {
      text += fmt::format(" {}: {},", frame.number, usd_lens(frame.camera->intrinsics, metres_per_unit).*value);
    }
    text += " }\n";
  }
  return text + "    }\n";
}

/// Rotations about X, Y and Z, degrees, of R = Ry Rx Rz.
Vec3d angles_zxy(const Mat3d& r) {
  constexpr double kDegrees = 180 / std::numbers::pi, kStraightUp = 1 - 1e-12;
  const double sine = -r.rows[1].z;
  const double x = std::asin(std::clamp(sine, -1.0, 1.0));
  if (std::abs(sine) > kStraightUp) return Vec3d{x, std::atan2(-r.rows[2].x, r.rows[0].x), 0} * kDegrees;
  return Vec3d{x, std::atan2(r.rows[0].z, r.rows[2].z), std::atan2(r.rows[1].x, r.rows[1].y)} * kDegrees;
}

/// The same angle, within half a turn of the former one: programs interpolate.
double near_angle(double degrees, double former) {
  return degrees - 360 * std::round((degrees - former) / 360);
}

}  // namespace

std::vector<ShotFrame> frames_of_shot(const std::vector<bake::Camera>& cameras) {
  std::vector<ShotFrame> frames;
  std::set<int> numbers;
  for (const bake::Camera& camera : cameras) {
    const std::optional<int> number = number_at_end(camera.name);
    if (number) numbers.insert(*number);
    frames.push_back({number.value_or(0), &camera});
  }
  const bool are_numbered = numbers.size() == cameras.size();
  for (std::size_t i = 0; i < frames.size() && !are_numbered; ++i) frames[i].number = int(i) + 1;
  std::ranges::sort(frames, {}, &ShotFrame::number);
  return frames;
}

void write_cameras_usd(const std::vector<bake::Camera>& cameras, const VdbOptions& up, const Label& label,
                       const std::filesystem::path& file) {
  const Affined turn = file_from_world(up, label.world);
  const double metres_per_unit = label.world.metres_per_unit;
  const std::vector<ShotFrame> frames = frames_of_shot(cameras);
  std::string times;
  if (!frames.empty()) {
    times = fmt::format("    startTimeCode = {}\n    endTimeCode = {}\n    timeCodesPerSecond = 24\n",
                        frames.front().number, frames.back().number);
  }
  std::string text = usd_begin(up_axis_of_file(up, label.world), label, times);
  std::set<std::string> taken;
  for (const bake::Camera& camera : cameras) text += still_camera(camera, turn, metres_per_unit, taken);
  if (!frames.empty()) text += moving_camera(frames, turn, metres_per_unit);
  write_file(file, text + "}\n");
}

void write_chan(const std::vector<bake::Camera>& cameras, const WorldConvention& world,
                const std::filesystem::path& file) {
  const Affined y_up = turned_up(world.up_axis, "y");
  std::string text = "# frame, x y z, rotations about X Y Z (degrees, order ZXY), vertical angle of view (degrees)\n";
  Vec3d former{};
  for (const ShotFrame& frame : frames_of_shot(cameras)) {
    const Affined pose = y_up * looking_backwards(frame.camera->world_from_camera);
    Vec3d angles = angles_zxy(pose.linear);
    for (int axis = 0; axis < 3; ++axis) angles[axis] = near_angle(angles[axis], former[axis]);
    former = angles;
    const Intrinsics& lens = frame.camera->intrinsics;
    const double view = 2 * std::atan(lens.height / (2 * lens.fy)) * 180 / std::numbers::pi;
    const Vec3d& at = pose.translation;
    text += fmt::format("{}\t{:.9f}\t{:.9f}\t{:.9f}\t{:.9f}\t{:.9f}\t{:.9f}\t{:.9f}\n", frame.number, at.x, at.y, at.z,
                        angles.x, angles.y, angles.z, view);
  }
  write_file(file, text);
}

}  // namespace cnerf::exporting
