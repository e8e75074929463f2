#pragma once
/// Rigid poses out of matrices that were rounded, printed or estimated, and cameras that none can be.

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "src/capture/camera.h"

namespace cnerf {

/// Largest size of a coordinate, world units.
inline constexpr double kFarthest = 1e9;
/// Largest deviation of R^T R from the identity that counts as rounding and is repaired.
inline constexpr double kLargestPoseError = 1e-2;
/// Deviation from which a repair is worth a note to the user.
inline constexpr double kNotedPoseError = 1e-4;

/// Largest absolute entry of R^T R - I.
[[nodiscard]] double orthonormality_error(const Mat3d& rotation);

/// The pose with its rotation replaced by the nearest rotation.
/// @param file, field  for messages
/// @throws InputError  NaN or infinity, a mirrored or singular matrix, or one that is not a rotation within
///                     kLargestPoseError.
[[nodiscard]] Affined rigid_pose(const Affined& pose, const std::filesystem::path& file, const std::string& field);

/// Turns the axes of a camera that looks along -Z with +Y up (OpenGL, Blender, NeRF) into those of camera.h. Its own
/// inverse.
[[nodiscard]] Affined opencv_from_opengl_camera(const Affined& world_from_camera);

/// Rows of the 4x4 matrix in the convention of transforms.json: the camera looks along -Z, +Y is up.
[[nodiscard]] inline std::array<std::array<double, 4>, 4> transforms_matrix(const Affined& world_from_camera) {
  std::array<std::array<double, 4>, 4> matrix{};
  for (int i = 0; i < 3; ++i) {
    const Vec3d r = world_from_camera.linear.rows[i];
    matrix[std::size_t(i)] = {r.x, -r.y, -r.z, world_from_camera.translation[i]};
  }
  matrix[3][3] = 1;
  return matrix;
}

struct ImplausibleNumber {
  std::string field, problem;  ///< "focal length", "principal point", "distortion" or "position"
};

/// The first number that no camera has. It is a mistake in the file it came from: with it, training would run into an
/// empty field, and a picture take forever.
/// @param centre  of the camera, world units
[[nodiscard]] std::optional<ImplausibleNumber> implausible_number(const Intrinsics& lens, Vec3d centre);

/// Rotation of a Hamilton quaternion.  @throws InputError  when its length is not 1 within kLargestPoseError.
[[nodiscard]] Mat3d rotation_from_quaternion(double w, double x, double y, double z, const std::filesystem::path& file,
                                             const std::string& field);

}  // namespace cnerf
