#pragma once
/// A monochrome multi-view capture: what every reader makes and all else consumes. Plain data.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "src/base/aabb.h"
#include "src/capture/camera.h"
#include "src/capture/mono_image.h"

namespace cnerf {

struct View {
  std::string name;                  ///< file as the poses name it, e.g. "images/0001.jpg"
  std::filesystem::path image_file;  ///< the file that was read
  Intrinsics intrinsics;             ///< of `image`, i.e. after any downscale
  Affined world_from_camera;         ///< rigid; camera axes as camera.h says
  MonoImage image;
  bool held_out = false;  ///< only for evaluation, never trained on
};

/// A point of structure from motion.
struct SparsePoint {
  Vec3d position;                    ///< world
  double error = 0;                  ///< mean distance from where pictures show it, pixels
  std::vector<std::uint32_t> views;  ///< whose pictures show it: places in `Capture::views`, ascending

  bool operator==(const SparsePoint&) const = default;
};

/// Where the points lie.
[[nodiscard]] inline std::vector<Vec3d> positions_of(const std::vector<SparsePoint>& points) {
  std::vector<Vec3d> positions;
  positions.reserve(points.size());
  for (const SparsePoint& point : points) positions.push_back(point.position);
  return positions;
}

/// What a source says about depth along the optical axis, in world units.
struct DepthRange {
  double near = 0, far = 0;
};

struct Capture {
  std::filesystem::path root;
  std::string format;                     ///< "transforms", "colmap", "llff"
  std::vector<View> views;                ///< sorted by name within the source's own order; at least 2
  std::vector<SparsePoint> points;        ///< of structure from motion; may be empty
  std::optional<DepthRange> depth_range;  ///< LLFF's bounds
  std::optional<Aabbd> bounds;     ///< the source's own box around its subject ("aabb" of transforms.json), world
  bool is_bounded_object = false;  ///< every view has alpha: nothing outside the object matters
  int listed_images = 0;           ///< images the poses file lists, of which `views.size()` exist
  std::vector<std::string> notes;  ///< what a user should know: missing images, conversions
  /// Digest of poses and lenses of the views to train on, as the source has them: whatever the downscale, and wherever
  /// the folder lies. Who moves cameras leaves it. Empty: unknown.
  std::string cameras;
};

}  // namespace cnerf
