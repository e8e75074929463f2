#pragma once
/// What is seen beyond a scene, as a picture.

#include <vector>

namespace cnerf {

/// Equirectangular, in the axes of the poses' frame, as src/render/direction_map.h lays it out: +x in the middle, +z
/// up, +y a quarter to the left.
struct SkyPicture {
  int width = 0, height = 0;
  std::vector<float> rgb;  ///< [H, W, 3] linear Rec.709, the top row first
};

}  // namespace cnerf
