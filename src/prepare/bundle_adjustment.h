#pragma once
/// Cameras and lenses from where their pictures show the same points: bundle adjustment (Triggs et al. 2000), by Ceres.

#include <vector>

#include "src/base/observer.h"
#include "src/capture/capture.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/stage1_options.h"

namespace cnerf::prepare {

struct AdjustedCameras {
  LearnedViews moved;               ///< from where they were given; its unit is the world's; empty: left alone
  std::vector<SparsePoint> points;  ///< that they show; none where outlines bound the space
  double evidence = 0;              ///< that they were off: F statistic, see below; 0: views show too few points
  double error_before = 0, error_after = 0;  ///< median distance of the same points from their features, pixels
};

/// Whether a training with these options begins with cameras that were adjusted: if it is to learn poses or lenses, and
/// the capture has no points of its own, whose maker adjusted the cameras to them.
[[nodiscard]] bool adjusts_cameras(const Capture& capture, const Stage1Options& options);

/// Moves the cameras of training views, or changes focal lengths, k1 and k2, until points appear where views show them:
/// what the options say is to be learned. Held-out views are not looked at: they keep their poses, and get the lens
/// that they share with training views. The same capture gives the same cameras.
///
/// Captures that show too few points keep theirs, and so do those whose cameras, moved, explain the points hardly
/// better than points alone could be moved: F = ((S0 - S1) / (k1 - k0)) / (S1 / (n - k1)) of nested models, with S, the
/// robust cost, and k, the parameters, of the fit without (0) and with (1) cameras, and n numbers that features say.
/// @param capture  changed in place, as `apply_learned_views` does by what is returned
/// @throws Interrupted  when the observer cancels; the capture may be changed
AdjustedCameras adjust_cameras(Capture& capture, const Stage1Options& options, Observer& observer);

}  // namespace cnerf::prepare
