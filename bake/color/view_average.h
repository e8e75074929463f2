#pragma once
/// Luminance without its dependence on the view: the mean of what the cameras of a capture see.

#include <memory>
#include <span>
#include <vector>

#include "bake/camera.h"
#include "bake/density/levels.h"
#include "bake/visibility/view_selection.h"
#include "src/base/observer.h"
#include "src/engine/engines.h"
#include "src/field/color_field.h"

namespace cnerf::bake {

/// What a bake makes of a field's luminance, at any point of it and not only in voxels.
class ViewAverage {
 public:
  /// @param field   must outlive this object.
  /// @param levels  density of the bake (bake_levels).  @param views  who sees what of it; made of these levels.
  ViewAverage(const ColorField& field, std::unique_ptr<const std::vector<Level>> levels,
              std::unique_ptr<const ViewSelection> views);
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
  const std::unique_ptr<const std::vector<Level>> levels_;  ///< at the place that `views_` points to
  const std::unique_ptr<const ViewSelection> views_;
};

/// After baking density on the lattices that `options` ask for.  @throws as plan_within_budget and bake_levels.
[[nodiscard]] std::unique_ptr<ViewAverage> make_view_average(const ColorField& field,
                                                             const std::vector<Camera>& cameras, const Options& options,
                                                             const Engines& engines, Observer& observer);

}  // namespace cnerf::bake
