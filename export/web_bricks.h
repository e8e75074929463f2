#pragma once
/// Baked voxels -> the quantised bricks that the page turns into textures. Plain arrays, no files.

#include <cstdint>
#include <string>
#include <vector>

#include "bake/baked_volume.h"

namespace cnerf {

inline constexpr int kWebBrickSide = 8;
inline constexpr int kWebBrickVoxels = kWebBrickSide * kWebBrickSide * kWebBrickSide;

/// A grid of bricks of 8^3 voxels, of which those are stored that trilinear interpolation can find density in: their
/// own voxels and one layer around them. x runs fastest everywhere, then y, then z.
struct WebBricks {
  Vec3d origin{};            ///< world position of the corner of the first voxel
  double voxel_size = 0;     ///< world units
  Vec3i counts{};            ///< bricks along each axis
  std::size_t voxels = 0;    ///< with density
  double max_density = 0;    ///< 1/world unit, of the volume
  double density_scale = 0;  ///< r8: density = density_scale * (code / 255)^3; beyond it, nothing can be told apart
  /// [counts] 0 = stored; else how many bricks away, along any axis, the nearest stored one is, at most 255.
  std::vector<std::uint8_t> distance;
  std::vector<std::uint8_t> density;  ///< r8: [N, 512] codes; r16f: [N, 512] low bytes, then [N, 512] high bytes
  /// [3, N, 512]: L* 255 / 100; a + 128; b + 128. Where nothing is, whatever packs best.
  std::vector<std::uint8_t> lab;

  [[nodiscard]] std::size_t stored() const { return lab.size() / (3 * kWebBrickVoxels); }
};

/// @param density  "r8" or "r16f".
/// @throws ContractError  when no voxel has density, or on another `density`.
[[nodiscard]] WebBricks make_web_bricks(const BakedVolume& volume, const std::string& density = "r8");

/// Replaces every value of bricks of 8^3 by its difference, modulo 256, to the one before it: along x, at the start of
/// a row along y, at the start of a layer along z. The first of a brick stays. Neighbours are alike, so this packs
/// better.
void to_differences(std::vector<std::uint8_t>& bricks);

/// The first estimate of a bundle's size, before anything is packed.
struct WebEstimate {
  std::size_t download_bytes = 0;  ///< about
  std::size_t texture_bytes = 0;   ///< in the browser's graphics memory
};
[[nodiscard]] WebEstimate estimate_web(const WebBricks& bricks);

}  // namespace cnerf
