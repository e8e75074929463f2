// Camera paths on disk, in the manner of transforms.json.

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "src/base/json.h"
#include "src/capture/pose.h"
#include "src/render/camera_path.h"

namespace cnerf {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kLargestSide = 1 << 15;  ///< pixels

/// One frame of the file and the file's own values behind it.
class Frame {
 public:
  Frame(const std::filesystem::path& file, const Json& whole, const Json& frame, std::size_t index)
      : file_(file), whole_(whole), frame_(frame), name_(fmt::format("frames[{}]", index)) {}

  [[noreturn]] void refuse(const std::string& field, const std::string& problem) const {
    throw InputError(file_, name_ + "." + field, problem);
  }

  [[nodiscard]] std::optional<double> number(const char* field) const {
    for (const Json* json : {&frame_, &whole_}) {
      if (!json->contains(field)) continue;
      const Json& value = json->at(field);
      if (!value.is_number()) refuse(field, "expected a number, got " + excerpt(value));
      return value.get<double>();
    }
    return std::nullopt;
  }

  [[nodiscard]] Intrinsics intrinsics() const {
    const auto w = number("w"), h = number("h");
    const auto is_side = [](const std::optional<double>& side) { return side && *side >= 1 && *side <= kLargestSide; };
    if (!is_side(w) || !is_side(h)) {
      refuse("w, h", fmt::format("expected the size of the picture, 1 to {} pixels each", kLargestSide));
    }
    Intrinsics result;
    result.width = int(*w);
    result.height = int(*h);
    if (const auto fl_x = number("fl_x")) {
      result.fx = *fl_x;
    } else if (const auto angle = number("camera_angle_x")) {
      result.fx = *w / (2 * std::tan(*angle / 2));
    }
    if (!(result.fx > 0) || !std::isfinite(result.fx))
      refuse("fl_x", "expected a positive focal length, or camera_angle_x");
    result.fy = number("fl_y").value_or(result.fx);
    result.cx = number("cx").value_or(*w / 2);
    result.cy = number("cy").value_or(*h / 2);
    return result;
  }

  [[nodiscard]] Affined world_from_camera() const {
    const char* field = "transform_matrix";
    const Json matrix = frame_.is_object() ? frame_.value(field, Json()) : Json();
    if (!matrix.is_array() || matrix.size() < 3) refuse(field, "expected a 4x4 matrix");
    Affined pose;
    for (int i = 0; i < 3; ++i) {
      if (!matrix[i].is_array() || matrix[i].size() != 4) refuse(field, "expected a 4x4 matrix");
      for (int j = 0; j < 4; ++j) {
        if (!matrix[i][j].is_number()) refuse(field, "expected numbers, got " + excerpt(matrix[i][j]));
        (j < 3 ? pose.linear.rows[i][j] : pose.translation[i]) = matrix[i][j].get<double>();
      }
    }
    return opencv_from_opengl_camera(rigid_pose(pose, file_, name_ + "." + field));
  }

 private:
  const std::filesystem::path& file_;
  const Json& whole_;
  const Json& frame_;
  std::string name_;
};

}  // namespace

CameraPath path_from_file(const std::filesystem::path& file) {
  const Json json = read_json(file);
  const Json frames = json.is_object() ? json.value("frames", Json()) : Json();
  if (!frames.is_array() || frames.empty()) throw InputError(file, "frames", "expected a list of cameras");
  CameraPath path{file.stem().string(), {}};
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Frame frame(file, json, frames[i], i);
    const PathCamera camera{fmt::format("frame_{:04}", i), frame.intrinsics(), frame.world_from_camera()};
    const auto found = implausible_number(camera.intrinsics, camera.world_from_camera.translation);
    if (found) frame.refuse(found->field, found->problem);
    path.cameras.push_back(camera);
  }
  return path;
}

}  // namespace cnerf
