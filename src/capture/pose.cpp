#include "src/capture/pose.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "src/base/error.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

bool is_finite(Vec3d v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool is_finite(const Affined& pose) {
  return is_finite(pose.linear.rows[0]) && is_finite(pose.linear.rows[1]) && is_finite(pose.linear.rows[2]) &&
         is_finite(pose.translation);
}

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

/// Newton's iteration for the polar decomposition (Higham 1986): converges to the nearest rotation.
Mat3d nearest_rotation(Mat3d m) {
  for (int step = 0; step < 8; ++step) {
    const Mat3d inverse_transposed = m.inverse().transposed();
    for (int row = 0; row < 3; ++row) m.rows[row] = (m.rows[row] + inverse_transposed.rows[row]) * 0.5;
  }
  return m;
}

}  // namespace

double orthonormality_error(const Mat3d& rotation) {
  const Mat3d product = rotation.transposed() * rotation;
  double worst = 0;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      worst = std::max(worst, std::abs(product.rows[row][column] - (row == column ? 1.0 : 0.0)));
    }
  }
  return worst;
}

Affined rigid_pose(const Affined& pose, const fs::path& file, const std::string& field) {
  if (!is_finite(pose)) throw InputError(file, field, "expected finite numbers, found NaN or infinity");
  const double determinant = pose.linear.determinant();
  if (std::abs(determinant) < 1e-9) {
    throw InputError(file, field,
                     "expected a rotation, found a singular matrix (determinant " + number(determinant) + ")");
  }
  if (determinant < 0) {
    throw InputError(file, field,
                     "expected a rotation, found a mirrored matrix (determinant " + number(determinant) + ")");
  }
  const double error = orthonormality_error(pose.linear);
  if (error > kLargestPoseError) {
    throw InputError(file, field,
                     "expected a rotation, found axes that are not orthonormal (off by " + number(error) + ")");
  }
  return {nearest_rotation(pose.linear), pose.translation};
}

Affined opencv_from_opengl_camera(const Affined& world_from_camera) {
  const Mat3d& m = world_from_camera.linear;
  return {Mat3d::from_columns(m.column(0), -m.column(1), -m.column(2)), world_from_camera.translation};
}

std::optional<ImplausibleNumber> implausible_number(const Intrinsics& lens, Vec3d centre) {
  std::optional<ImplausibleNumber> found;
  const auto expect = [&](const char* field, double value, double least, double most) {
    if (found || (value >= least && value <= most)) return;  // false for NaN
    found = {field, fmt::format("expected a number from {:g} to {:g}, found {:g}", least, most, value)};
  };
  const double side = std::max(lens.width, lens.height);
  for (const double focal : {lens.fx, lens.fy}) expect("focal length", focal, 0.01 * side, 1000 * side);
  // A crop of a larger picture has its axis outside.
  for (const double middle : {lens.cx, lens.cy}) expect("principal point", middle, -10 * side, 11 * side);
  for (const double coefficient : lens.distortion) expect("distortion", coefficient, -1000, 1000);
  for (int axis = 0; axis < 3; ++axis) expect("position", centre[axis], -kFarthest, kFarthest);
  return found;
}

Mat3d rotation_from_quaternion(double w, double x, double y, double z, const fs::path& file, const std::string& field) {
  const double norm = std::sqrt(w * w + x * x + y * y + z * z);
  if (!(std::abs(norm - 1) <= kLargestPoseError)) {
    throw InputError(file, field, "expected a unit quaternion, found one of length " + number(norm));
  }
  return rotation_of<double>({w / norm, x / norm, y / norm, z / norm});
}

}  // namespace cnerf
