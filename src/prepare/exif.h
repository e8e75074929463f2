#pragma once
/// EXIF notes of a photograph that help to find poses, read by libexif.

#include <cstddef>
#include <span>
#include <string>

namespace cnerf::prepare {

struct ExifFacts {
  int orientation = 1;    ///< 1 to 8, as EXIF numbers them: how stored pixels have to be turned to stand upright
  double focal_mm = 0;    ///< 0: not stated
  double focal_35mm = 0;  ///< focal length of a 36 x 24 mm frame with the same angle of view; 0: not stated
  std::string camera;     ///< maker and model; empty: not stated
};

/// Reads the EXIF block of a JPEG, PNG (chunk eXIf) or TIFF file held in memory. A file without one, or with a broken
/// one, gives the defaults: a photograph is not refused for its notes.
[[nodiscard]] ExifFacts read_exif(std::span<const std::byte> file);

/// Focal length in pixels of an image whose longer side is `longer_side` pixels; 0 when the notes do not tell it.
[[nodiscard]] double focal_pixels(const ExifFacts& exif, int longer_side);

}  // namespace cnerf::prepare
