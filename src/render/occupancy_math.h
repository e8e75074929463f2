#pragma once
/// The rules of the occupancy grid, once for every device: where a point lies, which cells an update visits, what a
/// cell remembers, and from which density on it counts as occupied.

#include <cmath>
#include <cstdint>

#include "src/base/host_device.h"
#include "src/base/rng.h"
#include "src/base/vec3.h"

namespace cnerf {

inline constexpr float kExcludedCell = -1.0f;  ///< density of a cell that is empty for good
inline constexpr float kNeverSeenCell = 1e9f;  ///< before its first look, a cell counts as occupied

/// Which cells one update visits: every `stride`-th, from cell `phase` on.
struct OccupancyUpdate {
  std::size_t stride = 1, phase = 0;
  std::uint64_t jitter_seed = 0;  ///< selects the points inside the cells

  /// Cells that are visited, of `cells`.
  [[nodiscard]] CNERF_HD std::size_t count(std::size_t cells) const { return (cells - phase + stride - 1) / stride; }
  [[nodiscard]] CNERF_HD std::size_t cell(std::size_t index) const { return phase + index * stride; }
  /// Where the update looks inside a cell, in [0, 1)^3 of it.
  [[nodiscard]] CNERF_HD Vec3f place_in(std::size_t cell) const {
    constexpr std::uint64_t kStream = 204;
    const CounterRng rng(jitter_seed, kStream);
    return {rng.uniform(3 * cell), rng.uniform(3 * cell + 1), rng.uniform(3 * cell + 2)};
  }
};

/// A cell's density after a visit that found `sigma`: the larger of it and what is left of the old one.
[[nodiscard]] CNERF_HD inline float remembered_density(float before, float sigma, float decay) {
  if (before == kExcludedCell) return before;
  const float left = before == kNeverSeenCell ? 0.0f : before * decay;
  return left < sigma ? sigma : left;
}

/// Mean density of a cascade's cells that are not excluded.
template <typename Real>
struct MeanDensity {
  Real sum = 0, cells = 0;

  CNERF_HD void add(float density) {
    if (density == kExcludedCell) return;
    const float most = 1e4f;  // a single solid cell is not to decide about all others
    sum += density < most ? density : most;
    cells += 1;
  }
  [[nodiscard]] CNERF_HD float value() const { return float(sum / (1 + cells)); }
};

/// Density above which a cell is occupied. Early in training nothing reaches the optical thickness asked for; then
/// cells denser than the mean are what is worth sampling.
[[nodiscard]] CNERF_HD inline float occupancy_threshold(float optical_thickness, float cell_side, float mean_density) {
  const float dense = optical_thickness / cell_side;
  return mean_density < dense ? mean_density : dense;
}

struct OccupancyLayout {
  int resolution = 128;
  int cascades = 1;
  float innermost = 1;  ///< side of cascade 0's cube, unit space

  OccupancyLayout() = default;
  OccupancyLayout(int cells_per_side, int n_cascades)
      : resolution(cells_per_side), cascades(n_cascades), innermost(std::ldexp(1.0f, 1 - n_cascades)) {}

  /// Side of a cascade's cube, unit space.
  [[nodiscard]] CNERF_HD float side(int cascade) const { return float(1u << unsigned(cascade)) * innermost; }
  [[nodiscard]] CNERF_HD float cell_side(int cascade) const { return side(cascade) / float(resolution); }

  /// The innermost cascade whose box holds `p`, of [0, 1]^3: the largest of what its coordinates ask for.
  [[nodiscard]] CNERF_HD int cascade_of(Vec3f p) const {
    const float x = std::abs(p.x - 0.5f), y = std::abs(p.y - 0.5f), z = std::abs(p.z - 0.5f);
    return cascade_at(x > y ? (x > z ? x : z) : (y > z ? y : z));
  }
  [[nodiscard]] CNERF_HD int cascade_of(float coordinate) const { return cascade_at(std::abs(coordinate - 0.5f)); }
  /// Index of the cell that holds `p`, over all cascades, x fastest.
  [[nodiscard]] CNERF_HD std::size_t cell_of(int cascade, Vec3f p) const { return index_of(cascade, p, resolution); }
  /// Index of the aligned cube of `8^3` cells that holds `p`.
  [[nodiscard]] CNERF_HD std::size_t block_of(int cascade, Vec3f p) const {
    return index_of(cascade, p, resolution / 8);
  }
  [[nodiscard]] CNERF_HD std::size_t cells_of_cascade() const {
    return std::size_t(resolution) * std::size_t(resolution) * std::size_t(resolution);
  }
  /// The point of a cell at `within`, in [0, 1)^3 of the cell.
  [[nodiscard]] CNERF_HD Vec3f point_in(std::size_t cell, Vec3f within) const {
    const auto r = std::size_t(resolution);
    const Vec3f corner = {float(cell % r), float(cell / r % r), float(cell / (r * r) % r)};
    const Vec3f in_cascade = (corner + within) / float(resolution) - Vec3f{0.5f, 0.5f, 0.5f};
    return in_cascade * side(int(cell / (r * r * r))) + Vec3f{0.5f, 0.5f, 0.5f};
  }

  /// The cell along one axis that holds a coordinate.
  [[nodiscard]] CNERF_HD std::size_t cell_along(int cascade, float coordinate) const {
    return cell_along(cascade, coordinate, resolution);
  }
  /// Index of the cell that lies so far along each axis.
  [[nodiscard]] CNERF_HD std::size_t cell_at(int cascade, std::size_t x, std::size_t y, std::size_t z) const {
    return index_at(cascade, x, y, z, resolution);
  }

 private:
  /// @param distance  of a coordinate from the middle
  [[nodiscard]] CNERF_HD int cascade_at(float distance) const {
    int k = 0;
    while (k + 1 < cascades && 2.0f * distance > side(k)) ++k;
    return k;
  }
  [[nodiscard]] CNERF_HD std::size_t cell_along(int cascade, float coordinate, int r) const {
    const float scale = 1.0f / side(cascade);
    const int cell = int(((coordinate - 0.5f) * scale + 0.5f) * float(r));
    return std::size_t(cell < 0 ? 0 : cell >= r ? r - 1 : cell);
  }
  [[nodiscard]] CNERF_HD static std::size_t index_at(int cascade, std::size_t x, std::size_t y, std::size_t z, int r) {
    return ((std::size_t(cascade) * std::size_t(r) + z) * std::size_t(r) + y) * std::size_t(r) + x;
  }
  [[nodiscard]] CNERF_HD std::size_t index_of(int cascade, Vec3f p, int r) const {
    return index_at(cascade, cell_along(cascade, p.x, r), cell_along(cascade, p.y, r), cell_along(cascade, p.z, r), r);
  }
};

}  // namespace cnerf
