#pragma once
/// How far things are, as far as sparse points tell it.

#include <vector>

#include "src/capture/capture.h"
#include "src/field/scene_frame.h"
#include "src/render/depth_math.h"

namespace cnerf {

/// Of the training views, in their order: a picture of distances between each view's points, the surer the nearer its
/// points are and the more they agree. Where none is near nothing is known. Empty without points.
[[nodiscard]] std::vector<DepthHints> depth_hints(const Capture& capture, const SceneFrame& frame,
                                                  const std::vector<SparsePoint>& points);

}  // namespace cnerf
