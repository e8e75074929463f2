#pragma once
/// A monochrome multi-view capture: what every reader makes and all else consumes. Plain data.

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

/// What a source says about depth along the optical axis, in world units.
struct DepthRange {
  double near = 0, far = 0;
};

struct Capture {
  std::filesystem::path root;
  std::string format;                     ///< "transforms", "colmap", "llff"
  std::vector<View> views;                ///< sorted by name within the source's own order; at least 2
  std::vector<Vec3d> points;              ///< sparse points of structure from motion, world; may be empty
  std::optional<DepthRange> depth_range;  ///< LLFF's bounds
  std::optional<Aabbd> bounds;     ///< the source's own box around its subject ("aabb" of transforms.json), world
  bool is_bounded_object = false;  ///< every view has alpha: nothing outside the object matters
  int listed_images = 0;           ///< images the poses file lists, of which `views.size()` exist
  std::vector<std::string> notes;  ///< what a user should know: missing images, conversions
};

}  // namespace cnerf
