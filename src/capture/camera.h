#pragma once
/// Cameras. The one place that states the conventions:
///  * camera axes are OpenCV's: +X right, +Y down, +Z forward; readers convert whatever they read;
///  * pixel coordinates are continuous, the centre of the first pixel is (0.5, 0.5);
///  * `world` is the frame the poses came in, in its units.

#include <array>
#include <optional>

#include "src/base/vec3.h"

namespace cnerf {

enum class LensModel {
  kPinhole,
  kOpenCv,         ///< k1 k2 p1 p2 k3 k4 k5 k6 (Brown-Conrady with rational denominator)
  kOpenCvFisheye,  ///< k1 k2 k3 k4 on the angle to the axis (Kannala and Brandt 2006)
};

struct Intrinsics {
  LensModel model = LensModel::kPinhole;
  int width = 0, height = 0;              ///< pixels
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels
  std::array<double, 8> distortion{};     ///< in the order the model's comment gives; unused entries are 0
  friend bool operator==(const Intrinsics&, const Intrinsics&) = default;
};

struct PixelPosition {
  double x = 0, y = 0;
};

/// Unit direction, in camera axes, of the ray through a pixel position. Inverts the distortion by Newton's method.
[[nodiscard]] Vec3d ray_direction(const Intrinsics& intrinsics, PixelPosition pixel);

/// Where a point given in camera axes lands; nothing when it is not in front of the camera, or so far off axis that the
/// lens model folds back into the image.
[[nodiscard]] std::optional<PixelPosition> project(const Intrinsics& intrinsics, Vec3d point_in_camera);

/// The same camera for an image resized to `width` x `height`.
[[nodiscard]] Intrinsics resized(const Intrinsics& intrinsics, int width, int height);

}  // namespace cnerf
