#pragma once
/// Field -> textured mesh.

#include <vector>

#include "bake/bake_camera.h"
#include "bake/bake_levels.h"
#include "bake/baked_mesh.h"
#include "bake/mesh/mesh_options.h"
#include "src/base/progress.h"
#include "src/field/color_field.h"

namespace cnerf {

/// The surface of a baked density, reduced and unwrapped, and a texture of what the cameras see of it. The caller fills
/// in `colorizer` and `take` of the result.
/// Same result for any number of threads.
/// @param level    without a hole; see merged_level.
/// @param cameras  of the capture: a texel's luminance is the mean of what they see.
/// @throws UsageError     on options that contradict each other, or charts that do not fit into the texture.
/// @throws InputError     when nothing in the box is opaque enough to have a surface.
/// @throws ContractError  when the field answers NaN, infinity or a negative density.
/// @throws Interrupted    on Ctrl-C.
[[nodiscard]] BakedMesh bake_mesh(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                  const BakeLevel& level, const BakeOptions& bake, const MeshOptions& options,
                                  const ProgressSink& progress = {});
/// The same after baking density itself, on one lattice whatever `bake.grids` says.
[[nodiscard]] BakedMesh bake_mesh(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                  const BakeOptions& bake, const MeshOptions& options,
                                  const ProgressSink& progress = {});

}  // namespace cnerf
