#pragma once
/// The sky of a capture: which pixels show it, and the light that comes from there.

#include <span>
#include <vector>

#include "src/capture/capture.h"
#include "src/render/direction_map.h"
#include "src/render/training_views.h"
#include "src/render/view_correction.h"

namespace cnerf {

struct SeenSky {
  std::vector<std::vector<SkyLabel>> labels;  ///< [training views][H, W]; empty: that view shows no sky
  DirectionMap light;                         ///< linear Y at the median view's exposure; there is none: no view does

  /// How many views show it, and how much of all pixels it is.
  [[nodiscard]] int views() const;
  [[nodiscard]] double share(std::span<const TrainingView> of) const;

  /// Views and steps know of it. It has to outlive them.
  void show_to(std::vector<TrainingView>& views) const;
};

/// Looks for it: above the horizon, from the border of the picture inwards, brighter than what is dark below, and
/// without structure or sparse points. Half of the views have to show it, and alike. Where cameras stood upright, on
/// the whole, it is found; a sky that a filter made dark is not, nor one behind leaves alone.
/// @param views   the training views
/// @param points  of structure from motion; their `views` are places in `capture.views`
[[nodiscard]] SeenSky find_sky(const Capture& capture, std::span<const TrainingView> views,
                               const std::vector<SparsePoint>& points);

/// The mean over the views of what their sky pixels show; smooth where none looked.
/// @param labels       as in SeenSky, of some view at least one pixel
/// @param corrections  of the views; empty: none
[[nodiscard]] DirectionMap sky_light(std::span<const TrainingView> views,
                                     const std::vector<std::vector<SkyLabel>>& labels,
                                     std::span<const ViewCorrection> corrections);

}  // namespace cnerf
