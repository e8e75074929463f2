#include "bake/lattice/plan.h"

#include <cmath>
#include <cstdio>
#include <sstream>
#include <vector>

#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

constexpr int kScanCells = 128;  ///< cells a cascade's side is scanned with; what occupancy grids have
constexpr int kMaxResolution = 1 << 15;

Aabbd parse_box(const std::string& text) {
  Aabbd box;
  char rest = 0;
  const int read = std::sscanf(text.c_str(), " %lf , %lf , %lf , %lf , %lf , %lf %c", &box.min.x, &box.min.y,
                               &box.min.z, &box.max.x, &box.max.y, &box.max.z, &rest);
  if (read != 6) throw UsageError("aabb: expected six numbers x0,y0,z0,x1,y1,z1, got \"" + text + "\"");
  for (int axis = 0; axis < 3; ++axis) {
    if (!(box.min[axis] < box.max[axis])) throw UsageError("aabb: the first corner must be below the second: " + text);
  }
  return box;
}

Aabbd intersection(const Aabbd& a, const Aabbd& b) {
  Aabbd both;
  for (int axis = 0; axis < 3; ++axis) {
    both.min[axis] = std::max(a.min[axis], b.min[axis]);
    both.max[axis] = std::min(a.max[axis], b.max[axis]);
    if (both.min[axis] >= both.max[axis]) throw UsageError("aabb: lies outside the box of the trained field");
  }
  return both;
}

/// Cells of one plane of a cascade that hold something: by occupancy, and by density if a threshold is given.
struct PlaneBoxes {
  Aabbd occupied = Aabbd::empty(), dense = Aabbd::empty();
};

void grow_by_cell(Aabbd& box, Vec3d centre, double side) {
  box.grow(centre - Vec3d{side, side, side} * 0.5);
  box.grow(centre + Vec3d{side, side, side} * 0.5);
}

PlaneBoxes scan_plane(const ColorField& field, double corner, double cell, int plane, float sigma_unit_threshold) {
  PlaneBoxes boxes;
  std::vector<Vec3d> centres;
  std::vector<Vec3f> positions;
  for (int j = 0; j < kScanCells; ++j) {
    for (int k = 0; k < kScanCells; ++k) {
      const Vec3d centre = Vec3d{plane + 0.5, j + 0.5, k + 0.5} * cell + Vec3d{corner, corner, corner};
      if (!field.may_be_occupied(centre.cast<float>())) continue;
      grow_by_cell(boxes.occupied, centre, cell);
      centres.push_back(centre);
      for (int s = 0; s < 8; ++s) {
        const Vec3d offset{(s & 1) - 0.5, (s >> 1 & 1) - 0.5, (s >> 2 & 1) - 0.5};
        positions.push_back((centre + offset * (0.5 * cell)).cast<float>());
      }
    }
  }
  std::vector<float> sigma(positions.size());
  field.query_density(positions, sigma);
  for (std::size_t c = 0; c < centres.size(); ++c) {
    const float densest = *std::max_element(sigma.begin() + 8 * c, sigma.begin() + 8 * (c + 1));
    if (densest >= sigma_unit_threshold) grow_by_cell(boxes.dense, centres[c], 3 * cell);  // one cell of margin
  }
  return boxes;
}

bool is_empty(const Aabbd& box) {
  return box.min.x > box.max.x;
}

void merge(Aabbd& into, const Aabbd& other) {
  if (is_empty(other)) return;
  into.grow(other.min);
  into.grow(other.max);
}

/// World box around the cells that are occupied and, if any is, dense enough to show. Occupancy alone is conservative:
/// stale cells far out would cost resolution.
Aabbd occupied_box(const ColorField& field, double opacity_threshold) {
  const SceneFrame& frame = field.frame();
  Aabbd occupied = Aabbd::empty(), dense = Aabbd::empty();
  for (int cascade = 0; cascade < frame.cascades; ++cascade) {
    const double side = std::ldexp(1.0, cascade - frame.cascades + 1);
    const double cell = side / kScanCells;
    const auto threshold = float(faintest_density(opacity_threshold, cell));
    std::vector<PlaneBoxes> planes(kScanCells);
    parallel_tasks(planes.size(), [&](std::size_t plane) {
      planes[plane] = scan_plane(field, 0.5 - side / 2, cell, int(plane), threshold);
    });
    for (const PlaneBoxes& plane : planes) {
      merge(occupied, plane.occupied);
      merge(dense, plane.dense);
    }
  }
  if (is_empty(occupied)) throw InputError("bake: the trained field is empty, there is nothing to bake");
  const Aabbd unit = intersection(is_empty(dense) ? occupied : dense, Aabbd{{0, 0, 0}, {1, 1, 1}});
  return {frame.world_from_unit(unit.min), frame.world_from_unit(unit.max)};
}

}  // namespace

Plan plan_bake(const ColorField& field, const Options& options) {
  Plan plan;
  plan.box = options.aabb.empty() ? occupied_box(field, options.opacity_threshold)
                                  : intersection(parse_box(options.aabb), field.frame().world_box());
  const Vec3d size = plan.box.size();
  const double longest = std::max({size.x, size.y, size.z});
  const int margin = options.dilation;
  if (options.voxel_size <= 0 && options.resolution <= 2 * margin) {
    throw UsageError("resolution: must exceed twice the dilation");
  }
  plan.voxel_size = options.voxel_size > 0 ? options.voxel_size : longest / (options.resolution - 2 * margin);
  if (longest / plan.voxel_size > kMaxResolution) {
    std::ostringstream message;
    message << "voxel_size: " << plan.voxel_size << " gives more than " << kMaxResolution
            << " voxels along an axis of a box " << longest << " long";
    throw UsageError(message.str());
  }
  for (int axis = 0; axis < 3; ++axis) {
    // A box that is a whole number of voxels long keeps that number in spite of rounding.
    const int inner = std::max(1, int(std::ceil(size[axis] / plan.voxel_size - 1e-6)));
    plan.resolution[axis] = inner + 2 * margin;
    plan.origin[axis] = plan.box.min[axis] - margin * plan.voxel_size;
  }
  return plan;
}

}  // namespace cnerf::bake
