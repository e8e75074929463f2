#pragma once
/// Luminance without its dependence on the view: the mean of what the cameras of a capture see.

#include <memory>
#include <span>
#include <vector>

#include "bake/bake_camera.h"
#include "bake/bake_levels.h"
#include "bake/view_selection.h"
#include "src/base/progress.h"
#include "src/field/color_field.h"

namespace cnerf {

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

/// What a bake makes of a field's luminance, at any point of it and not only in voxels.
class ViewAverage {
 public:
  /// @param field   must outlive this object.
  /// @param levels  density of the bake (bake_levels): it says which camera sees what.
  ViewAverage(const ColorField& field, const std::vector<BakeCamera>& cameras, std::vector<BakeLevel> levels,
              const BakeOptions& options);
  ViewAverage(const ViewAverage&) = delete;
  ViewAverage& operator=(const ViewAverage&) = delete;

  /// Linear Y at positions in unit space: the mean over at most `views_per_voxel` cameras that see the point, weighted
  /// by how much of its light reaches them; where none does, over the directions of the axes. Thread-safe; answers do
  /// not depend on what else is asked.
  /// @throws ContractError  as ViewMeans.
  /// @throws DeviceError    as ViewSelection::find.
  void query(std::span<const Vec3f> positions, std::span<float> luminance) const;

 private:
  /// Points of one brick: one order of cameras serves them all.
  struct Brick;
  [[nodiscard]] std::vector<Brick> by_brick(std::span<const Vec3f> positions) const;
  [[nodiscard]] std::size_t level_of(Vec3d world) const;
  void ask(std::span<const Brick> bricks_of_level, std::span<const Vec3f> positions, std::span<float> luminance) const;

  const ColorField& field_;
  const std::vector<BakeLevel> levels_;
  const std::unique_ptr<const ViewSelection> views_;
};

/// After baking density on the lattices that `options` ask for.  @throws as plan_within_budget and bake_levels.
[[nodiscard]] std::unique_ptr<ViewAverage> make_view_average(const ColorField& field,
                                                             const std::vector<BakeCamera>& cameras,
                                                             const BakeOptions& options,
                                                             const ProgressSink& progress = {});

}  // namespace cnerf
