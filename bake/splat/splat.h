#pragma once
/// 3-D Gaussians (Kerbl et al. 2023), as viewers of splats draw them: sorted by depth, each laid over what lies behind
/// it, in sRGB-encoded colours.

#include <array>
#include <bit>
#include <cstddef>
#include <vector>

#include "src/base/vec3.h"
#include "src/field/scene_frame.h"

namespace cnerf::bake {

/// Functions of direction beyond the constant one: spherical harmonics of degree 1 and 2.
inline constexpr int kShadings = 8;

template <typename Real>
struct BasicSplat {
  Vec3<Real> position;                       ///< world
  Vec3<Real> log_scale;                      ///< ln of the standard deviations along its own axes, world units
  std::array<Real, 4> rotation{1, 0, 0, 0};  ///< world_from_own, w x y z; of any length but 0
  Real opacity_logit{};                      ///< opacity at the centre is its sigmoid
  Vec3<Real> color;                          ///< sRGB-encoded, 0..1, before shading
  /// How the colour depends on the direction d in which it is looked at: it is multiplied by 1 + sum_i shading_i
  /// Y_i(d). One factor for the three encoded channels changes luminance and leaves chromaticity, but for sRGB's foot.
  std::array<Real, kShadings> shading{};
};
using Splat = BasicSplat<float>;

/// A splat as a row of numbers, in the order of its members.
inline constexpr std::size_t kSplatParameters = 14 + kShadings;
template <typename Real>
using SplatRow = std::array<Real, kSplatParameters>;
template <typename Real>
[[nodiscard]] SplatRow<Real> row_of(const BasicSplat<Real>& splat) {
  return std::bit_cast<SplatRow<Real>>(splat);
}
template <typename Real>
[[nodiscard]] BasicSplat<Real> splat_of(const SplatRow<Real>& row) {
  return std::bit_cast<BasicSplat<Real>>(row);
}

/// What a bake makes.
struct SplatCloud {
  std::vector<Splat> splats;  ///< rotations of length 1; neighbours in space are near each other
  SceneFrame frame;           ///< of the field they were made from
};

}  // namespace cnerf::bake
