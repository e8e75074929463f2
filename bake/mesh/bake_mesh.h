#pragma once
/// Field -> textured mesh.

#include <vector>

#include "bake/camera.h"
#include "bake/density/levels.h"
#include "bake/mesh.h"
#include "bake/options.h"
#include "src/base/progress.h"
#include "src/field/color_field.h"

namespace cnerf::bake {

/// The surface of a baked density, reduced and unwrapped, and a texture of what the cameras see of it.
/// Same result for any number of threads.
/// @param level    without a hole; see merged_level.
/// @param cameras  of the capture: a texel's luminance is the mean of what they see.
/// @throws UsageError     on options that contradict each other, or charts that do not fit into the texture.
/// @throws InputError     when nothing in the box is opaque enough to have a surface.
/// @throws ContractError  when the field answers NaN, infinity or a negative density.
/// @throws Interrupted    on Ctrl-C.
[[nodiscard]] Mesh bake_mesh(const ColorField& field, const std::vector<Camera>& cameras, const Level& level,
                             const Options& bake, const MeshOptions& options, const ProgressSink& progress = {});

}  // namespace cnerf::bake
