#pragma once
/// Cameras as files and pages write them down: pinholes in the capture's world, with the conventions of camera.h.

#include <array>
#include <filesystem>
#include <string>

#include "src/base/record.h"
#include "src/capture/camera.h"

namespace cnerf {

using Triple = std::array<double, 3>;

struct LensRecord {
  int width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("width", self.width);
    v("height", self.height);
    v("fx", self.fx);
    v("fy", self.fy);
    v("cx", self.cx);
    v("cy", self.cy);
  }
  friend bool operator==(const LensRecord&, const LensRecord&) = default;
};

struct CameraRecord {
  Triple position{};
  std::array<Triple, 3> rotation{};  ///< rows of world_from_camera
  LensRecord lens;

  [[nodiscard]] Intrinsics intrinsics() const;
  [[nodiscard]] Affined world_from_camera() const;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("position", self.position);
    v("rotation", self.rotation);
    v("lens", self.lens);
  }
  friend bool operator==(const CameraRecord&, const CameraRecord&) = default;
};

/// A camera that somebody stopped, beside the capture's own.
struct Viewpoint {
  std::string name;
  CameraRecord camera;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("name", self.name);
    CameraRecord::visit(self.camera, v);
  }
  friend bool operator==(const Viewpoint&, const Viewpoint&) = default;
};

inline constexpr std::size_t kMostViewpoints = 50;  ///< that are kept at a time

[[nodiscard]] Triple triple(Vec3d v);
/// A lens's distortion is left out.
[[nodiscard]] CameraRecord camera_record(const Intrinsics& lens, const Affined& world_from_camera);

/// @param largest_side  of its picture, pixels
/// @param where         the record's place in the file, "viewpoints[2]."; empty = it is the file
/// @throws InputError   naming the field: no rotation, or a lens or size beyond what is drawn
void check_camera(const CameraRecord& camera, int largest_side, const std::filesystem::path& file,
                  const std::string& where);

}  // namespace cnerf
