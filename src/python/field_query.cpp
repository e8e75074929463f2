#include "src/python/field_query.h"

#include <algorithm>
#include <vector>

#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"

namespace cnerf::python {
namespace {

/// Those of some points that are worth asking for.
struct Chosen {
  std::vector<std::size_t> index;
  std::vector<Vec3f> unit;
};

template <typename Wanted>
Chosen chosen(const ColorField& field, std::span<const Vec3d> positions, std::size_t begin, const Wanted& wanted) {
  Chosen some;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Vec3d p = field.frame().unit_from_world(positions[i]);
    const bool is_inside = std::min({p.x, p.y, p.z}) >= 0 && std::max({p.x, p.y, p.z}) <= 1;
    if (!is_inside || !wanted(p.cast<float>())) continue;
    some.index.push_back(begin + i);
    some.unit.push_back(p.cast<float>());
  }
  return some;
}

}  // namespace

void query_density(const ColorField& field, std::span<const Vec3d> positions, std::span<float> sigma) {
  std::ranges::fill(sigma, 0.0f);
  parallel_ranges(positions.size(), field.points_at_a_time(), [&](std::size_t begin, std::size_t end) {
    const auto is_occupied = [&](Vec3f p) { return field.may_be_occupied(p); };
    const Chosen some = chosen(field, positions.subspan(begin, end - begin), begin, is_occupied);
    std::vector<float> found(some.unit.size());
    if (!found.empty()) field.query_density(some.unit, found);
    for (std::size_t i = 0; i < found.size(); ++i) {
      sigma[some.index[i]] = found[i] * float(field.frame().unit_per_world);
    }
  });
}

void query_color(const ColorField& field, std::span<const Vec3d> positions, std::span<const Vec3d> directions,
                 std::span<Vec3f> rgb) {
  std::ranges::fill(rgb, Vec3f{});
  parallel_ranges(positions.size(), field.points_at_a_time(), [&](std::size_t begin, std::size_t end) {
    const auto any = [](Vec3f) { return true; };
    const Chosen some = chosen(field, positions.subspan(begin, end - begin), begin, any);
    if (some.unit.empty()) return;
    std::vector<Vec3f> seen_along(some.unit.size());
    for (std::size_t i = 0; i < seen_along.size(); ++i) {
      seen_along[i] = directions[directions.size() == 1 ? 0 : some.index[i]].cast<float>();
    }
    std::vector<float> luminance(some.unit.size());
    std::vector<Chromaticity> chromaticity(some.unit.size());
    field.query_luminance(some.unit, seen_along, luminance);
    field.query_chromaticity(some.unit, chromaticity);
    for (std::size_t i = 0; i < luminance.size(); ++i) {
      const auto& [x, z] = chromaticity[i];
      rgb[some.index[i]] = linear_rgb_from_relative_xyz(Vec3f{x, 1, z} * luminance[i]);
    }
  });
}

}  // namespace cnerf::python
