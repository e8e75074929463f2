#pragma once
/// The paper's own field (Sec. "Implementation details") behind the engines' interfaces, for comparison: an MLP of
/// eight layers of 256 with positional encoding, a coarse and a fine net, 64 + 64 samples a ray; LibTorch's autograd
/// trains it. On CUDA where LibTorch has it, else on the processor.
///
/// Loss, activations, random backgrounds, pixels and the colorizer's questions are those of the hash grid's engines, so
/// that what differs is the field. Stage 2 is the paper's Theta_Z: two layers of 128 and 313 classes on the point
/// encoding w of the fixed luminance field. It sees no directions, as no chroma field here does.

#include <memory>

#include "src/capture/capture.h"
#include "src/engine/engines.h"
#include "src/field/scene_frame.h"

namespace cnerf::compare {

inline constexpr int kCoarseSamples = 64, kFineSamples = 64;  ///< a ray; the fine net is evaluated at both
inline constexpr int kPositionFrequencies = 10, kDirectionFrequencies = 4;

/// Where samples lie on rays: from `near`, or the entry of the unit cube, to where the ray leaves it.
struct PositionalRays {
  float near = 0;             ///< unit lengths
  bool in_disparity = false;  ///< samples are spread evenly over 1 / t instead of t; needs near > 0
};
/// Objects in a single box: evenly in distance. All else: in disparity, from the capture's near bound where it has one.
[[nodiscard]] PositionalRays positional_rays(const Capture& capture, const SceneFrame& frame);

/// Engines of that field. Colours take over w of the luminance engine that they made or loaded last, and keep it fixed;
/// they start from random weights where there was none. A snapshot holds w in either case.
///
/// Of LuminanceEngineOptions, the grid, the marching and the occupancy mean nothing to it; `render` and `trace` take
/// their samples as training does. Snapshots continue bit for bit on the processor.
/// @param others  make the per-sample colour; must outlive these
[[nodiscard]] std::unique_ptr<Engines> positional_engines(const PositionalRays& rays,
                                                          const Engines& others = cpu_engines());

}  // namespace cnerf::compare
