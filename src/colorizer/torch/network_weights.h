#pragma once
/// Weights of the built-in network on disk: fp16, checksummed, readable on any machine.
///
/// Format, little-endian: 8 bytes "CNERFCW3"; 64 bytes hex SHA-256 of the content; one gzip member of the content's
/// bytes at even places, then of those at odd ones (a half's sign, exponent and first digits pack well, the rest does
/// not). The content: f64 temperature, f64 gain, u32 short side; u32 count; then for each parameter u32 name length,
/// name, u32 dimensions, u32 sizes, fp16 values in C order.

#include <filesystem>
#include <string>

#include "src/colorizer/torch/network.h"
#include "src/colorizer/torch/network_decode.h"

namespace cnerf {

struct ColorizerWeights {
  ColorizerNet network{nullptr};  ///< folded, in evaluation mode, on the CPU, f32
  AbDecoding decoding;
  std::string sha256;  ///< the checksum that was verified
};

/// @param network  a folded network.
void save_colorizer_weights(const std::filesystem::path& file, const ColorizerNet& network, const AbDecoding& decoding);

/// @throws MissingInputError  no such file.
/// @throws InputError         another format or version, a wrong checksum, parameters of another network.
[[nodiscard]] ColorizerWeights load_colorizer_weights(const std::filesystem::path& file);

/// Where the program's own weights lie: $CNERF_COLORIZER_WEIGHTS, beside the installed program in `../share/cnerf/`, or
/// in the source tree it was built from.
/// @throws MissingInputError  naming the places it looked at.
[[nodiscard]] std::filesystem::path builtin_weights_file();

}  // namespace cnerf
