#pragma once
/// The point queries of a trained scene that bakes, the viewer and evaluation use.

#include <cstddef>
#include <cstdint>
#include <span>

#include "src/base/vec3.h"
#include "src/field/scene_frame.h"

namespace cnerf {

/// Chromaticity of a sample relative to its luminance: its XYZ is Y * (x, 1, z) relative to the white point.
/// Grey is (1, 1). Linear in light, so compositing colours of samples composites their XYZ exactly.
struct Chromaticity {
  float x = 1, z = 1;
};

/// All positions are in unit space, [0, 1]^3; arrays of one call have equal sizes. Thread-safe.
class ColorField {
 public:
  virtual ~ColorField() = default;

  [[nodiscard]] virtual const SceneFrame& frame() const = 0;
  /// The batch size at which queries by one of many threads are efficient.
  [[nodiscard]] virtual std::size_t points_at_a_time() const { return std::size_t(1) << 12; }
  /// False where the occupancy grid says that the cell around `position` is empty.
  [[nodiscard]] virtual bool may_be_occupied(Vec3f position) const = 0;
  /// `may_be_occupied` for all points of a lattice.  @param marks  [x][y][z], written: 1 where `may_be_occupied`
  virtual void mark_occupied(std::span<const float> x, std::span<const float> y, std::span<const float> z,
                             std::span<std::uint8_t> marks) const {
    std::size_t at = 0;
    for (const float px : x) {
      for (const float py : y) {
        for (const float pz : z) marks[at++] = may_be_occupied({px, py, pz}) ? 1 : 0;
      }
    }
  }
  /// sigma: density, 1/unit-space length, >= 0. Not masked by occupancy.
  virtual void query_density(std::span<const Vec3f> positions, std::span<float> sigma) const = 0;
  /// luminance: linear Y seen when looking along `directions` (unit length, away from the camera).
  virtual void query_luminance(std::span<const Vec3f> positions, std::span<const Vec3f> directions,
                               std::span<float> luminance) const = 0;
  /// What `query_luminance` answers more of than the field was trained on: colours are those of that light, brighter.
  [[nodiscard]] virtual float gain() const { return 1; }
  /// Grey (1, 1) everywhere when the scene has not been colorized.
  virtual void query_chromaticity(std::span<const Vec3f> positions, std::span<Chromaticity> chromaticity) const = 0;
};

}  // namespace cnerf
