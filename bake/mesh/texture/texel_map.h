#pragma once
/// Which point of the surface every texel of a texture shows.

#include <cstdint>
#include <vector>

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

}  // namespace cnerf::bake
