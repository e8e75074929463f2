#pragma once
/// Which cameras see points of a bake.

#include <memory>
#include <span>
#include <vector>

#include "bake/camera.h"
#include "bake/density/levels.h"
#include "bake/visibility/clear_grid.h"
#include "bake/visibility/depth_maps.h"
#include "bake/visibility/sight_math.h"
#include "src/base/observer.h"
#include "src/engine/engines.h"

namespace cnerf::bake {

/// In the order of the cameras.
[[nodiscard]] std::vector<Eye> eyes_of(const std::vector<Camera>& cameras);

/// Order in which cameras are worth trying for points around `world`: first the one with the finest pixels there, then
/// always the one farthest, in direction, from those before it; so a few cameras already surround the point.
[[nodiscard]] std::vector<std::int32_t> try_order(std::span<const Eye> eyes, Vec3d world);

/// Unit direction from a camera to a point.
[[nodiscard]] Vec3f direction_to(const Eye& eye, Vec3d world);

/// Views that a question should ask for at most, points times `views_per_voxel`: it bounds the memory of the answer.
inline constexpr std::size_t kViewsAtATime = std::size_t(1) << 20;

/// A question about points of one level.
struct SightBatch {
  std::vector<Sight> sights;
  std::vector<std::int32_t> orders;  ///< [orders][cameras], each as try_order or order_for gives it
};

/// The answer.
struct SeenBatch {
  std::vector<SeenBy> seen;          ///< [sights][views_per_voxel], best first
  std::vector<std::int32_t> counts;  ///< [sights] how many of a point's are set
};

using DensityLevel = SightLevel<BrickGrid<float>>;
/// Points into `levels`, whose grids must outlive the result.
[[nodiscard]] std::vector<DensityLevel> density_levels(std::span<const Level> levels);

/// Answers "who sees this" for the points of a bake. Immutable; thread-safe. Light has to pass the density of all
/// levels.
class ViewSelection {
 public:
  /// @param levels  whose grids must outlive this object
  ViewSelection(const std::vector<Camera>& cameras, std::vector<DensityLevel> levels, const Options& options);
  virtual ~ViewSelection() = default;
  ViewSelection(const ViewSelection&) = delete;
  ViewSelection& operator=(const ViewSelection&) = delete;

  /// Prepares for many more points than pictures have pixels, most of which nothing sees. Before the first question.
  void map_depths();

  [[nodiscard]] const std::vector<Eye>& eyes() const { return eyes_; }
  [[nodiscard]] int views_per_voxel() const { return views_per_voxel_; }

  /// try_order for points of a ball, without the cameras of which map_depths says that they see nothing of it; -1
  /// stands for each of these at the end.
  [[nodiscard]] std::vector<std::int32_t> order_for(Vec3d centre, double radius) const;

  /// At most `views_per_voxel` cameras that have the point in their picture and see it, best first.
  /// @param level  that the point belongs to.  @param order, least  as try_order and Sight have them
  [[nodiscard]] std::vector<SeenBy> seen_by(std::size_t level, Vec3d world, std::span<const std::int32_t> order,
                                            float least = 0) const;
  /// The same for many points of a level at once, by all threads or the GPU; overwrites `answer`.
  /// @throws DeviceError  when the GPU's memory does not suffice
  virtual void find(std::size_t level, const SightBatch& batch, SeenBatch& answer) const;

 protected:
  [[nodiscard]] SightScene<BrickGrid<float>> scene() const;
  [[nodiscard]] const DepthMaps& depth_maps() const { return depth_maps_; }

 private:
  [[nodiscard]] SightScene<ClearGrid> clear_scene() const;

  std::vector<Eye> eyes_;
  std::vector<DensityLevel> levels_;
  std::vector<ClearGrid> grids_;  // of the levels
  std::vector<SightLevel<ClearGrid>> clear_levels_;
  DepthMaps depth_maps_;
  int views_per_voxel_;
};

/// Answers on the GPU, which gets a copy of all levels.  @throws DeviceError  when its memory does not suffice.
[[nodiscard]] std::unique_ptr<ViewSelection> make_view_selection_cuda(const std::vector<Camera>& cameras,
                                                                      const std::vector<DensityLevel>& levels,
                                                                      const Options& options);
/// On the GPU if the engines run there; on the processor where they do, and where the GPU's memory does not suffice,
/// which the observer is told.
[[nodiscard]] std::unique_ptr<ViewSelection> select_views(const std::vector<Camera>& cameras,
                                                          const std::vector<DensityLevel>& levels,
                                                          const Options& options, const Engines& engines,
                                                          Observer& observer);

}  // namespace cnerf::bake
