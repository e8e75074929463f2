#pragma once
/// Baked voxels -> the quantised bricks that the page turns into textures. Plain arrays, no files.

#include <cstdint>
#include <optional>
#include <vector>

#include "bake/out_of_core/planes.h"
#include "src/base/aabb.h"

namespace cnerf::exporting {

inline constexpr int kWebBrickSide = 8;
inline constexpr int kWebBrickVoxels = kWebBrickSide * kWebBrickSide * kWebBrickSide;

/// A grid of bricks of 8^3 voxels, of which those are stored that trilinear interpolation can find density in: their
/// own voxels and one layer around them. x runs fastest everywhere, then y, then z.
struct WebBricks {
  Vec3d origin{};            ///< world position of the corner of the first voxel
  double voxel_size = 0;     ///< world units
  Vec3i counts{};            ///< bricks along each axis
  Aabbd cover;               ///< world; what these voxels say all of, also where nothing is
  std::size_t voxels = 0;    ///< with density
  double max_density = 0;    ///< 1/world unit, of the volume
  double density_scale = 0;  ///< density = density_scale * (code / 255)^3; beyond it, nothing can be told apart
  /// [counts] 0 = stored; else how many bricks away, along any axis, the nearest stored one is, at most 255.
  std::vector<std::uint8_t> distance;
  std::vector<std::uint8_t> density;  ///< [N, 512] codes
  /// [3, N, 512]: L* 255 / 100; a + 128; b + 128. Where nothing is, whatever packs best.
  std::vector<std::uint8_t> lab;

  [[nodiscard]] std::size_t stored() const { return lab.size() / (3 * kWebBrickVoxels); }
};

/// Voxels of a volume that a box of the world touches; faces on faces do not.
[[nodiscard]] bake::VoxelBox voxels_of(const bake::Volume& volume, const Aabbd& box);

/// Values within a code or two of their neighbour's take it: L* changes by 0.6 at most, a and b by 2.5, where more than
/// a fiftieth of a pixel's light can come from a voxel; its density by 1.5 codes, and 4.5 where it is opaque.
/// @param cover  world; what the bricks are asked for. They end one voxel beyond, since interpolation reaches so far.
///               None: all of the volume, and the bricks are the cover.
/// @throws ContractError  when no voxel has density.
[[nodiscard]] WebBricks make_web_bricks(const bake::Volume& volume, const std::optional<Aabbd>& cover = {});

/// Replaces every value of bricks of 8^3 by its difference, modulo 256, to the one before it: along x, at the start of
/// a row along y, at the start of a layer along z. The first of a brick stays. Neighbours are alike, so this packs
/// better.
void to_differences(std::vector<std::uint8_t>& bricks);

}  // namespace cnerf::exporting
