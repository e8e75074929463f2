#pragma once
/// Space that sparse points and the sky prove empty.

#include <vector>

#include "src/capture/capture.h"
#include "src/render/training_views.h"

namespace cnerf {

/// Cosine of the angle between a lens's axis and the corner of the picture that is farthest from it.
[[nodiscard]] double least_cosine_of(const Intrinsics& lens);

/// A view that shows a sparse point sees through all that lies between: space around the way to it is empty, and what
/// is nearer to the lens than all that the view shows. Where it shows the sky it sees through everything. Two ways have
/// to agree, or one view's points together. Held-out views say nothing. What has no features at all, such as a white
/// thing before a picture's nearest point, is not protected.
class FreeSpace {
 public:
  /// Refers to the views.
  /// @param points  their `views` are places in `views`
  /// @param sky     [training views] as SeenSky has it; empty: none is seen
  FreeSpace(const std::vector<View>& views, const std::vector<SparsePoint>& points,
            const std::vector<std::vector<SkyLabel>>& sky = {});

  /// Whether enough views see through the whole ball, and no point lies in it. World space.
  [[nodiscard]] bool holds(Vec3d centre, double radius) const;

 private:
  /// What a view sees through: a small picture of depths along its axis, up to which all is empty.
  class Sight {
   public:
    /// @param sky  [H, W]; empty: the view shows none
    Sight(const View& view, const std::vector<Vec3d>& shown, const std::vector<SkyLabel>& sky);
    /// How much it says for a ball's being empty.
    [[nodiscard]] int votes_for(Vec3d centre, double radius) const;

   private:
    /// @param at  in the camera's axes, not in its picture or partly behind its lens
    [[nodiscard]] bool is_near_lens(Vec3d at, double radius) const;
    void clear_way_to(PixelPosition pixel, double depth);
    void clear_way_to_sky(const std::vector<SkyLabel>& sky);
    void clear_the_near(std::vector<double> depths);

    Affined camera_from_world_;
    const Intrinsics* lens_;
    double cells_per_pixel_ = 0;
    int width_ = 0, height_ = 0;
    std::vector<float> clear_depth_;  ///< [height, width], world units; 0: nothing is known
    double near_ = 0;                 ///< nothing that the view shows is nearer to its lens, world units
    double least_cosine_ = 1;         ///< of what the lens sees, to its axis
  };

  std::vector<Sight> sights_;
  std::vector<Vec3d> points_;
};

}  // namespace cnerf
