#pragma once
/// How EXIF turns pixels, pixel by pixel: what `turned_upright` is compared with.

#include <cstddef>

namespace cnerf::test {

/// A pixel grid as it is stored, its size after `orientation`, and the stored pixel that upright pixel (x, y) shows.
struct Upright {
  int orientation = 1;
  int stored_width = 0, stored_height = 0;

  [[nodiscard]] int width() const { return orientation < 5 ? stored_width : stored_height; }
  [[nodiscard]] int height() const { return orientation < 5 ? stored_height : stored_width; }
  [[nodiscard]] std::size_t stored_index(int x, int y) const {
    const int right = width() - 1 - x, bottom = height() - 1 - y;
    int column = x, row = y;
    switch (orientation) {
      case 2:
        column = right;
        break;
      case 3:
        column = right, row = bottom;
        break;
      case 4:
        row = bottom;
        break;
      case 5:
        column = y, row = x;
        break;
      case 6:
        column = y, row = right;
        break;
      case 7:
        column = bottom, row = right;
        break;
      case 8:
        column = bottom, row = x;
        break;
      default:
        break;
    }
    return std::size_t(row) * std::size_t(stored_width) + std::size_t(column);
  }
};

}  // namespace cnerf::test
