#pragma once
/// The pictures of a web bundle: photographs to lay over the volume, and a poster to show while it loads.

#include <cstddef>
#include <span>
#include <vector>

#include "bake/camera.h"
#include "bake/volume.h"
#include "src/capture/capture.h"

namespace cnerf::exporting {

/// A photograph as the page shows it, or none.
struct WebPhoto {
  std::vector<std::byte> jpeg;  ///< 8-bit grey sRGB without lens distortion; empty = none
  int width = 0, height = 0;
};

/// A pinhole camera with the focal lengths and the principal point of a lens.
[[nodiscard]] Intrinsics without_distortion(const Intrinsics& intrinsics);

/// Of views, as the program sees them, without the distortion of their lenses; made by all threads.
/// @param side  pixels of the longer side, at most
[[nodiscard]] std::vector<WebPhoto> make_web_photos(std::span<const View> views, int side, int quality);

/// WebP with alpha of what a camera sees of nested volumes, `side` pixels long at most: sRGB, not premultiplied.
[[nodiscard]] std::vector<std::byte> make_poster(std::span<const bake::Volume> volumes, const bake::Camera& camera,
                                                 int side);

}  // namespace cnerf::exporting
