#include "bake/density/nested.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "bake/density/density_pass.h"
#include "src/base/byte_count.h"
#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

constexpr std::size_t kMostLevels = 4;
constexpr int kLookResolution = 160;   ///< of the density that pixels are traced in
constexpr int kLookRays = 24;          ///< along each axis of a picture
constexpr double kPixelsPerVoxel = 2;  ///< that a voxel may cover
constexpr double kLeastShare = 0.15;   ///< of all pixels that must gain by a finer grid
constexpr int kCells = 32;             ///< along each axis, to look for its place
constexpr double kHalfOpaque = 0.693147;

/// What a pixel looks at, and how large voxels may be there.
struct Look {
  Vec3d world;
  double voxel_size;
};

std::vector<Look> looks_of(const Camera& camera, const Plan& plan, const BrickGrid<float>& sigma) {
  const Intrinsics& lens = camera.intrinsics;
  const Vec3d eye = camera.world_from_camera.translation;
  const Vec3d origin = plan.voxel_from_world(eye);
  const Aabbd box{{0, 0, 0}, plan.resolution.cast<double>()};
  std::vector<Look> looks;
  for (int ray = 0; ray < kLookRays * kLookRays; ++ray) {
    const int column = ray % kLookRays, row = ray / kLookRays;
    const PixelPosition pixel{(column + 0.5) * lens.width / kLookRays, (row + 0.5) * lens.height / kLookRays};
    const Vec3d d = normalized(camera.world_from_camera.direction(ray_direction(lens, pixel)));
    const auto inside = intersect(box, origin, d);
    if (!inside) continue;
    double depth = 0;
    for (double t = inside->begin + 0.5; t < inside->end && depth < kHalfOpaque; t += 1) {
      depth += sigma.at((origin + d * t).cast<int>()) * plan.voxel_size;
      if (depth < kHalfOpaque) continue;
      const double distance = t * plan.voxel_size;
      looks.push_back({eye + d * distance, kPixelsPerVoxel * distance / lens.fx});
    }
  }
  return looks;
}

/// Where the cameras' pixels end, in a density too coarse for anything else.
std::vector<Look> all_looks(const ColorField& field, const std::vector<Camera>& cameras, Options options) {
  options.resolution = std::min(options.resolution, kLookResolution);
  options.voxel_size = 0;
  options.subsamples = 1;
  const Plan plan = plan_bake(field, options);
  const BrickGrid<float> sigma = bake_density(field, plan, options, [](double) {});
  std::vector<std::vector<Look>> of_cameras(cameras.size());
  parallel_tasks(cameras.size(), [&](std::size_t c) { of_cameras[c] = looks_of(cameras[c], plan, sigma); });
  std::vector<Look> looks;
  for (const std::vector<Look>& some : of_cameras) looks.insert(looks.end(), some.begin(), some.end());
  return looks;
}

/// Counts of points in cells of a box, summed so that any block of cells takes eight look-ups.
class CellCounts {
 public:
  CellCounts(const Aabbd& box, const std::vector<Vec3d>& points) : sums_((kCells + 1) * (kCells + 1) * (kCells + 1)) {
    for (const Vec3d p : points) {
      Vec3i cell;
      for (int axis = 0; axis < 3; ++axis) {
        const double share = (p[axis] - box.min[axis]) / (box.max[axis] - box.min[axis]);
        cell[axis] = std::clamp(int(share * kCells), 0, kCells - 1);
      }
      ++at(cell + Vec3i{1, 1, 1});
    }
    for (int axis = 0; axis < 3; ++axis) {
      for (std::size_t i = 0; i < sums_.size(); ++i) {
        Vec3i cell = position(i);
        if (cell[axis] == 0) continue;
        --cell[axis];
        sums_[i] += at(cell);
      }
    }
  }
  /// In cells [low, low + size).
  [[nodiscard]] int in_block(Vec3i low, Vec3i size) const {
    int count = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3i upper{corner & 1, corner >> 1 & 1, corner >> 2};
      const int sign = (upper.x + upper.y + upper.z) % 2 == 1 ? 1 : -1;
      count += sign * sums_[index(low + Vec3i{upper.x * size.x, upper.y * size.y, upper.z * size.z})];
    }
    return count;
  }

 private:
  [[nodiscard]] static std::size_t index(Vec3i c) {
    return (std::size_t(c.x) * (kCells + 1) + c.y) * (kCells + 1) + c.z;
  }
  [[nodiscard]] static Vec3i position(std::size_t i) {
    const auto n = int(i);
    return {n / ((kCells + 1) * (kCells + 1)), n / (kCells + 1) % (kCells + 1), n % (kCells + 1)};
  }
  int& at(Vec3i cell) { return sums_[index(cell)]; }

  std::vector<int> sums_;
};

/// The part of `box`, at most `side` long along each axis, that holds most points; around them, if it holds any.
Aabbd fullest_part(const Aabbd& box, double side, const std::vector<Vec3d>& points) {
  const CellCounts counts(box, points);
  const Vec3d cell = box.size() / double(kCells);
  Vec3i size, best;
  for (int axis = 0; axis < 3; ++axis) size[axis] = std::clamp(int(side / cell[axis]), 1, kCells);
  int most = -1;
  for (int x = 0; x <= kCells - size.x; ++x) {
    for (int y = 0; y <= kCells - size.y; ++y) {
      for (int z = 0; z <= kCells - size.z; ++z) {
        const int count = counts.in_block({x, y, z}, size);
        if (count <= most) continue;
        most = count;
        best = {x, y, z};
      }
    }
  }
  Aabbd window;
  for (int axis = 0; axis < 3; ++axis) {
    window.min[axis] = box.min[axis] + best[axis] * cell[axis];
    window.max[axis] = window.min[axis] + size[axis] * cell[axis];
  }
  Aabbd around = Aabbd::empty();
  for (const Vec3d p : points) {
    if (window.contains(p)) around.grow(p);
  }
  if (around.min.x > around.max.x) return window;
  for (int axis = 0; axis < 3; ++axis) {  // what lies behind the points belongs to them
    window.min[axis] = std::max(window.min[axis], around.min[axis] - cell[axis]);
    window.max[axis] = std::min(window.max[axis], around.max[axis] + cell[axis]);
  }
  return window;
}

/// A lattice of half the voxel size for the part of `parent` around `box`, cut out of the parent.
Plan finer_plan(Plan& parent, const Aabbd& box, int margin) {
  Plan plan;
  plan.voxel_size = parent.voxel_size / 2;
  for (int axis = 0; axis < 3; ++axis) {
    const double low = (box.min[axis] - parent.origin[axis]) / parent.voxel_size;
    const double high = (box.max[axis] - parent.origin[axis]) / parent.voxel_size;
    parent.hole_min[axis] = std::max(margin, int(std::floor(low)));
    parent.hole_max[axis] = std::min(parent.resolution[axis] - margin, int(std::ceil(high)));
    plan.resolution[axis] = 2 * (parent.hole_max[axis] - parent.hole_min[axis]) + 2 * margin;
  }
  const Aabbd cut{parent.world_from_voxel(parent.hole_min.cast<double>()),
                  parent.world_from_voxel(parent.hole_max.cast<double>())};
  plan.origin = cut.min - Vec3d{1, 1, 1} * (margin * plan.voxel_size);
  for (int axis = 0; axis < 3; ++axis) {
    plan.box.min[axis] = std::max(cut.min[axis], parent.box.min[axis]);
    plan.box.max[axis] = std::min(cut.max[axis], parent.box.max[axis]);
  }
  return plan;
}

/// Of a voxel that lets through as much light as the eight voxels of half its size from `first` on.
double density_of_finer(const BrickGrid<float>& finer, Vec3i first, double voxel_size) {
  double alpha = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const float sigma = finer.at(first + Vec3i{corner & 1, corner >> 1 & 1, corner >> 2});
    alpha -= std::expm1(-sigma * voxel_size) / 8;
  }
  return std::min(max_sigma(voxel_size), -std::log1p(-alpha) / voxel_size);
}

/// Puts a finer level's density where its parent is cut out for it.
void fill_hole(Level& parent, const Level& finer, double opacity_threshold) {
  const Vec3i low = parent.plan.hole_min, high = parent.plan.hole_max;
  const double faintest = faintest_density(opacity_threshold, parent.plan.voxel_size);
  for (int i = low.x; i < high.x; ++i) {
    for (int j = low.y; j < high.y; ++j) {
      for (int k = low.z; k < high.z; ++k) {
        const Vec3d corner = parent.plan.world_from_voxel(Vec3i{i, j, k}.cast<double>());
        const Vec3d there = finer.plan.voxel_from_world(corner) + Vec3d{0.5, 0.5, 0.5};  // faces meet: a whole number
        const double sigma = density_of_finer(finer.sigma, there.cast<int>(), parent.plan.voxel_size);
        if (sigma > 0 && sigma >= faintest) parent.sigma.set({i, j, k}, float(sigma));
      }
    }
  }
  parent.plan.hole_min = parent.plan.hole_max = {};
}

}  // namespace

std::vector<Plan> plan_levels(const ColorField& field, const std::vector<Camera>& cameras, const Options& options) {
  std::vector<Plan> plans{plan_bake(field, options)};
  const bool nested = options.grids == "nested" || (options.grids == "auto" && field.frame().cascades > 1);
  if (!nested || cameras.empty()) return plans;
  std::vector<Look> looks = all_looks(field, cameras, options);
  const auto enough = std::size_t(kLeastShare * double(looks.size()));
  const Vec3i resolution = plans[0].resolution;
  const int inner = std::max({resolution.x, resolution.y, resolution.z}) - 2 * options.dilation;
  while (plans.size() < kMostLevels) {
    Plan& parent = plans.back();
    std::vector<Vec3d> wanting;
    for (const Look& look : looks) {
      if (look.voxel_size < parent.voxel_size && parent.box.contains(look.world)) wanting.push_back(look.world);
    }
    const double side = (inner - 2) * parent.voxel_size / 2;  // rounding outwards adds two voxels
    const Aabbd box = fullest_part(parent.box, side, wanting);
    const auto gaining =
        std::size_t(std::count_if(wanting.begin(), wanting.end(), [&](Vec3d p) { return box.contains(p); }));
    if (gaining == 0 || gaining < enough) break;
    plans.push_back(finer_plan(parent, box, options.dilation));
  }
  std::reverse(plans.begin(), plans.end());
  return plans;
}

std::size_t cycles_bytes(const std::vector<Plan>& plans) {
  constexpr std::size_t kBytesOfVoxel = 4 * (1 + 4);
  std::size_t bytes = 0;
  for (const Plan& plan : plans) bytes += plan.lattice_voxels() * kBytesOfVoxel;
  return bytes;
}

std::vector<Plan> plan_within_budget(const ColorField& field, const std::vector<Camera>& cameras,
                                     const Options& options) {
  std::vector<Plan> plans = plan_levels(field, cameras, options);
  if (options.budget.empty()) return plans;
  const auto budget = double(bytes_from("budget", options.budget));
  constexpr int kLeastResolution = 16;
  Options smaller = options;
  while (double(cycles_bytes(plans)) > budget) {
    const double ratio = 0.98 * std::cbrt(budget / double(cycles_bytes(plans)));
    if (smaller.voxel_size > 0) {
      smaller.voxel_size /= ratio;
    } else {
      smaller.resolution = int(smaller.resolution * ratio);
    }
    const Vec3i resolution = plans.back().resolution;
    if (ratio * std::max({resolution.x, resolution.y, resolution.z}) < kLeastResolution) {
      throw UsageError("budget: " + options.budget + " is too little for a volume");
    }
    plans = plan_levels(field, cameras, smaller);
  }
  return plans;
}

Level merged_level(std::vector<Level> levels, const Options& options) {
  Level merged = std::move(levels.front());
  for (std::size_t next = 1; next < levels.size(); ++next) {
    Level coarser = std::move(levels[next]);
    fill_hole(coarser, merged, options.opacity_threshold);
    merged = std::move(coarser);
  }
  return merged;
}

}  // namespace cnerf::bake
