#include "export/splat_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>

#include "bake/splat/splat_math.h"
#include "export/usd_text.h"
#include "src/base/aabb.h"
#include "src/base/check.h"
#include "src/base/files.h"
#include "src/base/gzip.h"

namespace cnerf::exporting {
namespace fs = std::filesystem;
namespace {

constexpr float kConstantHarmonic = 0.28209479177387814f;
constexpr std::size_t kRest = std::tuple_size_v<SplatHarmonics> - 1;
static_assert(kRest == bake::kShadings);
static_assert(std::endian::native == std::endian::little, "files are little-endian");

// ---- SPZ ----

constexpr std::uint32_t kSpzMagic = 0x5053474e, kSpzVersion = 3;
constexpr float kSpzColorScale = 0.15f;
/// Bits that harmonics keep of eight: the fewer, the better the file compresses.
constexpr int kFirstDegreeBits = 6, kSecondDegreeBits = 5;

std::uint8_t in_byte(float value) {
  return std::uint8_t(std::clamp(std::round(value), 0.0f, 255.0f));
}

/// A coefficient of -1..1 in 8 bits, of which the highest `bits` differ from 0's.
std::uint8_t harmonic_byte(float value, int bits) {
  const int bucket = 1 << (8 - bits);
  const int whole = int(std::round(value * 128)) + 128;
  return std::uint8_t(std::clamp((whole + bucket / 2) / bucket * bucket, 0, 255));
}

/// A rotation without its largest part, each other in 10 bits, and which it is in the two highest.
std::uint32_t smallest_three(const std::array<float, 4>& wxyz) {
  const std::array<float, 4> q = {wxyz[1], wxyz[2], wxyz[3], wxyz[0]};
  constexpr float kMost = 0.70710678f;  // of a part that is not the largest
  constexpr std::uint32_t kMagnitude = (1 << 9) - 1;
  std::size_t largest = 0;
  for (std::size_t i = 1; i < 4; ++i) {
    if (std::abs(q[i]) > std::abs(q[largest])) largest = i;
  }
  auto packed = std::uint32_t(largest);
  for (std::size_t i = 0; i < 4; ++i) {
    if (i == largest) continue;
    const bool is_negative = (q[i] < 0) != (q[largest] < 0);
    const auto magnitude = std::uint32_t(std::round(float(kMagnitude) * std::min(1.0f, std::abs(q[i]) / kMost)));
    packed = packed << 10 | std::uint32_t(is_negative) << 9 | magnitude;
  }
  return packed;
}

/// Bytes from the lowest on.
void put(std::vector<std::uint8_t>& bytes, std::uint32_t value, int count) {
  for (int i = 0; i < count; ++i) bytes.push_back(std::uint8_t(value >> (8 * i)));
}

// ---- USD ----

constexpr int kPlaceDigits = 7, kDigits = 4;

template <typename Value>
void add_array(std::string& text, const std::string& name, const std::vector<bake::Splat>& splats, const Value& value) {
  text += "        " + name + " = [";
  for (std::size_t i = 0; i < splats.size(); ++i) {
    if (i > 0) text += i % 8 == 0 ? ",\n            " : ", ";
    value(splats[i], text);
  }
  text += "]";
}
void add_vector(std::string& text, Vec3f v, int digits) {
  fmt::format_to(std::back_inserter(text), "({:.{}g}, {:.{}g}, {:.{}g})", v.x, digits, v.y, digits, v.z, digits);
}

Vec3f scale_of(const bake::Splat& splat) {
  return {std::exp(splat.log_scale.x), std::exp(splat.log_scale.y), std::exp(splat.log_scale.z)};
}

/// Of the centres, and three deviations of the largest splat around them.
std::string extent_of(const bake::SplatCloud& cloud) {
  Aabbd box = Aabbd::empty();
  float largest = 0;
  for (const bake::Splat& splat : cloud.splats) {
    box.grow(splat.position.cast<double>());
    const Vec3f scale = scale_of(splat);
    largest = std::max({largest, scale.x, scale.y, scale.z});
  }
  const double margin = 3 * double(largest);
  const Vec3d low = box.min, high = box.max;
  return fmt::format("        float3[] extent = [({:.6g}, {:.6g}, {:.6g}), ({:.6g}, {:.6g}, {:.6g})]\n", low.x - margin,
                     low.y - margin, low.z - margin, high.x + margin, high.y + margin, high.z + margin);
}

}  // namespace

SplatHarmonics harmonics_of(const bake::Splat& splat) {
  SplatHarmonics harmonics;
  harmonics[0] = (splat.color - Vec3f{0.5f, 0.5f, 0.5f}) / kConstantHarmonic;
  for (std::size_t i = 0; i < kRest; ++i) harmonics[i + 1] = splat.color * splat.shading[i];
  return harmonics;
}

std::string splat_ply(const bake::SplatCloud& cloud, const std::string& comment) {
  std::string text = "ply\nformat binary_little_endian 1.0\ncomment " + comment + "\n";
  text += fmt::format("element vertex {}\n", cloud.splats.size());
  const auto property = [&](const std::string& name) { text += "property float " + name + "\n"; };
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"}) property(name);
  for (std::size_t i = 0; i < 3 * kRest; ++i) property(fmt::format("f_rest_{}", i));
  for (const char* name : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    property(name);
  }
  text += "end_header\n";
  std::vector<float> row;
  text.reserve(text.size() + cloud.splats.size() * (17 + 3 * kRest) * sizeof(float));
  for (const bake::Splat& splat : cloud.splats) {
    const SplatHarmonics harmonics = harmonics_of(splat);
    const auto& [x, y, z] = splat.position;
    row = {x, y, z, 0, 0, 0, harmonics[0].x, harmonics[0].y, harmonics[0].z};
    for (int c = 0; c < 3; ++c) {
      for (std::size_t i = 1; i <= kRest; ++i) row.push_back(harmonics[i][c]);
    }
    row.insert(row.end(), {splat.opacity_logit, splat.log_scale.x, splat.log_scale.y, splat.log_scale.z});
    row.insert(row.end(), splat.rotation.begin(), splat.rotation.end());
    text.append(reinterpret_cast<const char*>(row.data()), row.size() * sizeof(float));
  }
  return text;
}

int spz_fraction_bits(const bake::SplatCloud& cloud) {
  float farthest = 0;
  for (const bake::Splat& splat : cloud.splats) {
    for (int axis = 0; axis < 3; ++axis) farthest = std::max(farthest, std::abs(splat.position[axis]));
  }
  constexpr int kFewest = 0, kMost = 20, kWholeBits = 23;
  const int bits = kWholeBits - (farthest > 0 ? int(std::floor(std::log2(farthest))) + 1 : 0);
  CNERF_CHECK(bits >= kFewest, "splats lie farther away than SPZ's 24 bits hold");
  return std::min(kMost, bits);
}

std::vector<std::byte> splat_spz(const bake::SplatCloud& cloud) {
  const int fraction_bits = spz_fraction_bits(cloud);
  std::vector<std::uint8_t> bytes;
  bytes.reserve(16 + cloud.splats.size() * (20 + 3 * kRest));
  put(bytes, kSpzMagic, 4);
  put(bytes, kSpzVersion, 4);
  put(bytes, std::uint32_t(cloud.splats.size()), 4);
  bytes.insert(bytes.end(), {std::uint8_t(kSplatDegree), std::uint8_t(fraction_bits), 0, 0});
  const std::span<const bake::Splat> splats = cloud.splats;
  for (const bake::Splat& splat : splats) {
    for (int axis = 0; axis < 3; ++axis) {
      const double scaled = std::round(std::ldexp(double(splat.position[axis]), fraction_bits));
      put(bytes, std::uint32_t(std::int32_t(std::clamp(scaled, -8388608.0, 8388607.0))), 3);
    }
  }
  for (const bake::Splat& splat : splats) bytes.push_back(in_byte(255 * bake::sigmoid(splat.opacity_logit)));
  for (const bake::Splat& splat : splats) {
    const Vec3f constant = harmonics_of(splat)[0];
    for (int c = 0; c < 3; ++c) bytes.push_back(in_byte(255 * (constant[c] * kSpzColorScale + 0.5f)));
  }
  for (const bake::Splat& splat : splats) {
    for (int axis = 0; axis < 3; ++axis) bytes.push_back(in_byte(16 * (splat.log_scale[axis] + 10)));
  }
  for (const bake::Splat& splat : splats) put(bytes, smallest_three(splat.rotation), 4);
  for (const bake::Splat& splat : splats) {
    const SplatHarmonics harmonics = harmonics_of(splat);
    for (std::size_t i = 1; i <= kRest; ++i) {
      for (int c = 0; c < 3; ++c) {
        bytes.push_back(harmonic_byte(harmonics[i][c], i <= 3 ? kFirstDegreeBits : kSecondDegreeBits));
      }
    }
  }
  return gzip(bytes);
}

std::string splat_usd(const bake::SplatCloud& cloud, const Label& label) {
  const auto& splats = cloud.splats;
  std::string text = usd_begin(label.world.up_axis, label);
  text += "    def ParticleField3DGaussianSplat \"splats\"\n    {\n" + extent_of(cloud);
  add_array(text, "point3f[] positions", splats,
            [](const auto& splat, std::string& to) { add_vector(to, splat.position, kPlaceDigits); });
  add_array(text += "\n", "quatf[] orientations", splats, [](const auto& splat, std::string& to) {
    const auto& q = splat.rotation;
    fmt::format_to(std::back_inserter(to), "({:.5g}, {:.5g}, {:.5g}, {:.5g})", q[0], q[1], q[2], q[3]);
  });
  add_array(text += "\n", "float3[] scales", splats,
            [](const auto& splat, std::string& to) { add_vector(to, scale_of(splat), kDigits); });
  add_array(text += "\n", "float[] opacities", splats, [](const auto& splat, std::string& to) {
    fmt::format_to(std::back_inserter(to), "{:.4g}", bake::sigmoid(splat.opacity_logit));
  });
  text += fmt::format("\n        uniform int radiance:sphericalHarmonicsDegree = {}\n", kSplatDegree);
  add_array(text, "float3[] radiance:sphericalHarmonicsCoefficients", splats, [](const auto& splat, std::string& to) {
    const SplatHarmonics harmonics = harmonics_of(splat);
    for (std::size_t i = 0; i < harmonics.size(); ++i) add_vector(i == 0 ? to : to += ", ", harmonics[i], 3);
  });
  text += fmt::format(" (\n            elementSize = {}\n            interpolation = \"vertex\"\n        )\n",
                      std::tuple_size_v<SplatHarmonics>);
  text += "        uniform token projectionModeHint = \"perspective\"\n";
  text += "        uniform token sortingModeHint = \"zDepth\"\n    }\n}\n";
  return text;
}

SplatFiles write_splats(const bake::SplatCloud& cloud, const fs::path& folder, const std::string& name,
                        const Label& label) {
  CNERF_CHECK(!cloud.splats.empty(), "there are no splats to write");
  SplatFiles files{folder / (name + ".ply"), folder / (name + ".spz"), folder / (name + ".usda")};
  std::string comment = color_origin_text(label.provenance);
  std::ranges::replace(comment, '\n', ' ');
  write_file(files.ply, splat_ply(cloud, comment));
  write_file(files.spz, splat_spz(cloud));
  write_file(files.usd, splat_usd(cloud, label));
  return files;
}

}  // namespace cnerf::exporting
