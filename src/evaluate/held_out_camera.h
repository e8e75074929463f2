#pragma once
/// What is asked of a held-out view beside its picture: where its camera really stood, and whether the way before it is
/// free.

#include <cstddef>
#include <optional>
#include <vector>

#include "src/capture/capture.h"
#include "src/evaluate/pose_alignment.h"
#include "src/render/training_views.h"
#include "src/render/view_correction.h"
#include "src/train/luminance/learned_views.h"
#include "src/train/luminance/seen_scene.h"

namespace cnerf {

/// From the poses of the training views as a file gives them to those that were learned, with the similarity between
/// them taken as their frames' difference.
/// @param learned  a capture's views, with what was learned put into them.
/// @return         nothing where nobody moved a camera or changed a lens.
[[nodiscard]] std::optional<PoseAlignment> alignment_of(const Capture& learned, const LearnedViews& views);

struct FittedCamera {
  ViewCorrection correction;  ///< of where it was thought to be
  double psnr = 0;  ///< dB of sRGB-encoded luminance, of the right half of the picture, which was not looked at
};

/// Finds pose and gain of a view on the left half of its picture, by Levenberg and Marquardt's method with slopes by
/// differences. The field is held.
/// @param start  where the camera is thought to be
/// @return       nothing where a half has no pixel that counts
[[nodiscard]] std::optional<FittedCamera> fit_camera(const SeenScene& scene, const RenderEffort& effort,
                                                     const UnitCamera& start, const MonoImage& image);

/// Mean opacity of the first tenth of the rays' ways through the innermost box: of the fog in which a camera stands.
[[nodiscard]] double near_opacity(const SeenScene& scene, const RenderEffort& effort, const UnitCamera& camera);

}  // namespace cnerf
