#pragma once
/// Where each camera's sight ends: shadow maps (Williams 1978) of cameras, which spare most points that nothing sees
/// the way to the camera.

#include <span>
#include <vector>

#include "bake/visibility/clear_grid.h"
#include "bake/visibility/sight_math.h"

namespace cnerf::bake {

/// Of each camera, a cell per few pixels: the largest distance at which matter ends the rays of the cell and of those
/// around it, as `sight_end` has it. A gap that lies between the rays of cells is overlooked: single points that are
/// seen through it alone are called hidden. Then the same of squares of 2, 4, 8… cells.
class DepthMaps {
 public:
  DepthMaps() = default;
  /// By all threads.
  DepthMaps(std::span<const Eye> eyes, std::span<const SightLevel<ClearGrid>> levels);

  [[nodiscard]] bool is_empty() const { return places_.empty(); }
  [[nodiscard]] const std::vector<float>& values() const { return values_; }
  /// @param values  those above, or a copy of them in other memory
  [[nodiscard]] DepthMap map(std::size_t eye, const float* values) const;
  /// Whether a camera may see anything of a ball. @param eye  the one of that number
  [[nodiscard]] bool may_see(std::size_t number, const Eye& eye, Vec3d centre, double radius) const;

 private:
  /// Where a camera's cells begin in `values_`, and how many there are.
  struct Place {
    std::size_t first;
    int width, height;
  };
  void make(std::size_t number, const Eye& eye, std::span<const SightLevel<ClearGrid>> levels);

  std::vector<float> values_;
  std::vector<Place> places_;
  double pixels_per_cell_ = 1;
};

}  // namespace cnerf::bake
