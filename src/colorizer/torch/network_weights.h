#pragma once
/// Weights of the built-in network on disk: fp16, checksummed, readable on any machine. weights_content.h has the
/// format.

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

/// Weights of the large network need the encoder that they were trained beside.
/// @throws MissingInputError  no such file, or no encoder where one is needed.
/// @throws InputError         another format or version, a wrong checksum, parameters of another network, another
/// encoder.
[[nodiscard]] ColorizerWeights load_colorizer_weights(const std::filesystem::path& file);

/// Where the program's own weights lie: $CNERF_COLORIZER_WEIGHTS, beside the installed program in `../share/cnerf/`, or
/// in the source tree it was built from.
/// @throws MissingInputError  naming the places it looked at.
[[nodiscard]] std::filesystem::path builtin_weights_file();

}  // namespace cnerf
