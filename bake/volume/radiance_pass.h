#pragma once
/// Second pass of a bake: luminance as the cameras see it, and colour.

#include <span>
#include <vector>

#include "bake/density/density_pass.h"
#include "bake/density/levels.h"
#include "bake/visibility/view_selection.h"
#include "bake/volume.h"

namespace cnerf::bake {

/// Second pass over one level of a bake. Voxels that no camera sees are left out unless `keep_unseen`. So are those
/// that give less than `weight_threshold` of a pixel's light (transmittance times opacity) even to the camera that sees
/// them best. Luminance is the mean over the cameras that see the voxel, weighted by transmittance; where none does,
/// and everywhere when there are no cameras, over the six axis directions. Light passes through density as it was
/// baked, but what voxels are given is sharpened. Those fainter than `opacity_threshold` then keep their colour alone,
/// which is better than that of a neighbour.
class RadiancePass {
 public:
  /// @param levels  all levels of the bake; `level` is the one to bake, the others stand in its light
  /// @param views   who sees the points of these levels.  All three must outlive this object.
  RadiancePass(const ColorField& field, const std::vector<Level>& levels, std::size_t level, const ViewSelection& views,
               const Options& options);

  /// The voxels of a plane of the density pass with their colours, sorted by (i, j, k).
  /// @throws ContractError  when the field answers a luminance or chromaticity that is not finite.
  /// @throws DeviceError    as ViewSelection::find.
  [[nodiscard]] std::vector<Voxel> bake_plane(std::span<const DenseVoxel> dense, int plane) const;

 private:
  struct Candidates;
  struct Kept;
  void bake_bricks(std::span<const std::span<const DenseVoxel>> bricks, int plane, std::vector<Voxel>& voxels) const;
  [[nodiscard]] Kept seen_of(std::span<const std::span<const DenseVoxel>> bricks, int plane) const;
  [[nodiscard]] Candidates candidates_of(std::span<const DenseVoxel> brick, int plane) const;
  [[nodiscard]] Kept kept_of(const Candidates& candidates, const SeenBatch& seen, std::size_t first) const;
  [[nodiscard]] std::vector<Chromaticity> ask_chromaticity(std::span<const Vec3f> points) const;

  const ColorField& field_;
  const Level& level_;
  std::size_t level_number_;
  const ViewSelection& views_;
  double weight_threshold_;
  double sharpening_;
  double faintest_;  ///< density that is kept, 1/world unit
  bool keep_unseen_;
};

}  // namespace cnerf::bake
