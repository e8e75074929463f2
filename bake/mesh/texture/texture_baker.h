#pragma once
/// Surface with texture coordinates -> texture.

#include <functional>

#include "bake/mesh.h"
#include "bake/mesh/texture/texel_shader.h"
#include "bake/mesh/uv/unwrap.h"

namespace cnerf::bake {

/// Colours every texel that shows the surface, and fills the others in: within `reach` texels with the colour of the
/// nearest that has one, so that filtering at seams finds the right colour; beyond with the mean colour, which smaller
/// mip-maps then blend with. Same result for any number of threads.
/// @param advance  told the share done, in [0, 1], between batches; may throw.
[[nodiscard]] Texture bake_texture(const UnwrappedMesh& mesh, const TexelShader& shader, int reach,
                                   const std::function<void(double)>& advance);

/// The filling alone: spreads colours of texels with `coverage` over the others. A texel takes the mean of its
/// neighbours that were reached one step earlier.
void fill_in(Texture& texture, int reach);

}  // namespace cnerf::bake
