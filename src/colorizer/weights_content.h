#pragma once
/// What a file of the built-in network's weights holds, without the library that runs the network.
///
/// Format, little-endian: 8 bytes "CNERFCW4"; 64 bytes hex SHA-256 of the content; one gzip member of the content's
/// bytes at even places, then of those at odd ones (a half's sign, exponent and first digits pack well, the rest does
/// not). The content: f64 temperature, f64 gain, u32 short side; u32 length of the encoder's SHA-256 and that, empty
/// for the small network; u32 count; then for each parameter u32 name length, name, u32 dimensions, u32 sizes, fp16
/// values in C order. Version 3, "CNERFCW3", has no encoder.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cnerf {

inline constexpr std::string_view kWeightsMagic = "CNERFCW4", kWeightsMagicWithoutEncoder = "CNERFCW3";
inline constexpr std::size_t kWeightsChecksumBytes = 64;

struct WeightsContent {
  struct Parameter {
    std::string name;
    std::vector<std::int64_t> shape;
    std::span<const std::byte> halves;  ///< of `bytes`
  };
  std::string sha256;  ///< the checksum that was verified
  double temperature = 0, gain = 0;
  std::uint32_t short_side = 0;  ///< any
  std::string encoder;           ///< SHA-256 of the one beside the large network; empty for the small one
  std::vector<Parameter> parameters;
  std::vector<std::byte> bytes;
};

/// Where the weights may lie; the first that is there counts.
[[nodiscard]] std::vector<std::filesystem::path> builtin_weights_places();

/// @throws MissingInputError  no such file.
/// @throws InputError         another format or version, a wrong checksum, parameters beyond the end of the file.
[[nodiscard]] WeightsContent read_weights_content(const std::filesystem::path& file);

}  // namespace cnerf
