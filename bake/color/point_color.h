#pragma once
/// What a field answers about points: luminance over the directions they are looked at along, chromaticity, and the
/// colour that these two give.

#include <span>
#include <vector>

#include "src/field/color_field.h"

namespace cnerf::bake {

/// Linear Rec.709 and its Lab a, b for a luminance and a chromaticity. In gamut: chroma gives way at constant lightness
/// and hue. Grey gives three equal numbers and a = b = 0 exactly.
struct VoxelColor {
  Vec3f rgb{};
  float a = 0, b = 0;
};
/// @param gain  of the field: the gamut is that of the light without it
[[nodiscard]] VoxelColor voxel_color(float luminance, Chromaticity chromaticity, float gain = 1);

/// Chromaticity of points in unit space, by as many threads as are free.
/// @throws ContractError  when the field answers one that is not finite.
[[nodiscard]] std::vector<Chromaticity> chromaticity_of(const ColorField& field, std::span<const Vec3f> points);

/// Points, each with the directions it is looked at along, for one question to the field.
class ViewMeans {
 public:
  /// Adds a direction (unit length, away from the camera) to the point at hand.
  void look_along(Vec3f unit, Vec3f direction, float weight);
  /// Adds the six directions of the axes: for points that no camera sees.
  void look_from_all_sides(Vec3f unit);
  /// The point at hand is complete: it has at least one direction.
  void next_point() { ends_.push_back(positions_.size()); }
  /// Adds another list's points.
  void append(const ViewMeans& others);

  /// [points] linear Y, >= 0: the weighted mean over each point's directions. Asked by as many threads as are free.
  /// @throws ContractError  when the field answers a luminance that is not finite.
  [[nodiscard]] std::vector<float> luminance(const ColorField& field) const;

 private:
  std::vector<Vec3f> positions_, directions_;
  std::vector<float> weights_;
  std::vector<std::size_t> ends_;  // of each point's directions
};

}  // namespace cnerf::bake
