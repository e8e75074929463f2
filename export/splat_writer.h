#pragma once
/// Splats as files of other programs, all in the frame of the poses: nothing is turned.
///
/// Colours are sRGB-encoded, as viewers expect them: colour = 1/2 + sum_i f_i Y_i(d) over real spherical harmonics with
/// Condon and Shortley's signs, d from the camera to the splat.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "bake/splat/splat.h"
#include "export/options.h"

namespace cnerf::exporting {

/// The degree of the harmonics in all files.
inline constexpr int kSplatDegree = 2;

/// Coefficients of a splat's harmonics, [(degree + 1)^2] of red, green and blue.
using SplatHarmonics = std::array<Vec3f, (kSplatDegree + 1) * (kSplatDegree + 1)>;
[[nodiscard]] SplatHarmonics harmonics_of(const bake::Splat& splat);

/// Binary PLY with the properties of Kerbl et al. 2023: x y z, nx ny nz (0), f_dc_*, f_rest_* (all of red, then green,
/// blue), opacity (logit), scale_* (ln), rot_* (w x y z). Floats.
[[nodiscard]] std::string splat_ply(const bake::SplatCloud& cloud, const std::string& comment);

/// Niantic's SPZ, version 3: gzip around a header of 16 bytes and columns of quantised values. Version 2 has coarser
/// rotations; what writes version 4 (zstd) is ahead of most readers.
/// @throws ContractError  where a position lies beyond what 24 bits hold
[[nodiscard]] std::vector<std::byte> splat_spz(const bake::SplatCloud& cloud);
/// Bits of a coordinate below the point, as many as the farthest one leaves.
[[nodiscard]] int spz_fraction_bits(const bake::SplatCloud& cloud);

/// USD text with one ParticleField3DGaussianSplat (OpenUSD 26.03).
[[nodiscard]] std::string splat_usd(const bake::SplatCloud& cloud, const Label& label);

struct SplatFiles {
  std::filesystem::path ply, spz, usd;
};
/// Writes `name`.ply, .spz and .usda.  @throws OutputError.
SplatFiles write_splats(const bake::SplatCloud& cloud, const std::filesystem::path& folder, const std::string& name,
                        const Label& label);

}  // namespace cnerf::exporting
