#pragma once
/// What a training step draws its pixels from: images and poses in unit space. No colour: MonoImage has none.

#include <algorithm>
#include <cstdint>
#include <vector>

#include "src/capture/camera_math.h"
#include "src/capture/capture.h"
#include "src/capture/mono_image.h"
#include "src/field/scene_frame.h"
#include "src/render/depth_math.h"
#include "src/render/direction_map.h"
#include "src/render/ray.h"

namespace cnerf {

/// A camera in unit space.
struct UnitCamera {
  Intrinsics intrinsics;
  Mat3d unit_from_camera;  ///< rotation
  Vec3d origin;            ///< unit space

  UnitCamera() = default;
  UnitCamera(const Intrinsics& lens, const Affined& world_from_camera, const SceneFrame& frame)
      : intrinsics(lens),
        unit_from_camera(world_from_camera.linear),
        origin(frame.unit_from_world(world_from_camera.translation)) {}

  [[nodiscard]] CNERF_HD Ray ray(PixelPosition pixel) const {
    return {origin.cast<float>(), normalized(unit_from_camera * lens::ray_direction(intrinsics, pixel)).cast<float>()};
  }
  /// Through the middle of a pixel.  @param index  y * width + x
  [[nodiscard]] Ray ray_of_pixel(std::size_t index) const {
    const auto width = std::size_t(intrinsics.width);
    const std::size_t column = index % width, row = index / width;
    return ray({double(column) + 0.5, double(row) + 0.5});
  }
};

/// What is known of a pixel in a capture that sees a sky.
enum class SkyLabel : std::uint8_t {
  kScene,   ///< shows something in the box
  kEither,  ///< perhaps, or the sky between: an edge, a gap
  kFar,     ///< shows what is so far that it may lie beyond the box
  kSky,     ///< shows the sky: the way to it is empty
};

struct TrainingView {
  UnitCamera camera;
  const MonoImage* image = nullptr;
  int lens = 0;  ///< its place among the lenses that views share
  // Where a sky is seen; both null elsewhere.
  const std::vector<SkyLabel>* sky_labels = nullptr;  ///< [H, W]
  const DirectionMap* sky = nullptr;                  ///< its linear Y, at the median view's exposure
  const DepthHints* depths = nullptr;                 ///< null: nothing is known
};

/// The lenses of the views that are not held out, each once.
[[nodiscard]] inline std::vector<Intrinsics> lenses_of(const Capture& capture) {
  std::vector<Intrinsics> lenses;
  for (const View& view : capture.views) {
    if (!view.held_out && std::ranges::find(lenses, view.intrinsics) == lenses.end()) lenses.push_back(view.intrinsics);
  }
  return lenses;
}

/// The views that are not held out. `capture` must outlive the result.
[[nodiscard]] inline std::vector<TrainingView> training_views(const Capture& capture, const SceneFrame& frame) {
  std::vector<TrainingView> views;
  const std::vector<Intrinsics> lenses = lenses_of(capture);
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    views.push_back({UnitCamera(view.intrinsics, view.world_from_camera, frame), &view.image,
                     int(std::ranges::find(lenses, view.intrinsics) - lenses.begin())});
  }
  return views;
}

}  // namespace cnerf
