#pragma once
/// Surface with texture coordinates -> texture.

#include <cstdint>
#include <functional>
#include <vector>

#include "bake/mesh.h"
#include "bake/mesh/texture/texel_shader.h"
#include "bake/mesh/uv/unwrap.h"

namespace cnerf::bake {

struct SurfaceTexel {
  std::int32_t column = 0, row = 0;
  std::uint32_t triangle = 0;
  Vec3f position{};  ///< voxel coordinates
  Vec3f normal{};    ///< unit length
};

/// Texels that triangles reach, row by row: first come those whose centre lies in a triangle (one on a shared edge
/// belongs to one of the two), then those that a triangle only touches, which show its nearest point. So even a chart
/// thinner than a texel has some.
[[nodiscard]] std::vector<SurfaceTexel> surface_texels(const UnwrappedMesh& mesh);

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
