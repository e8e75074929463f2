#pragma once
/// Planes of floats -> OpenEXR, lossless.

#include <cstddef>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace cnerf {

struct ExrChannel {
  std::string name;
  std::span<const float> values;  ///< value i of the channel is `values[i * stride]`; rows from the top
  std::size_t stride = 1;
  bool half = false;  ///< stored in 16 bits; values beyond their range are clamped
};

struct ExrImage {
  int width = 0, height = 0;
  std::vector<ExrChannel> channels;
  std::map<std::string, std::string> attributes;  ///< text, beside the standard ones
};

/// ZIP-compressed, with the chromaticities of Rec.709 and D65. The file is whole or not there.
/// @throws ContractError  on a value that is not finite, or sizes that disagree.
/// @throws OutputError    when the file cannot be written.
void write_exr(const std::filesystem::path& file, const ExrImage& image);

}  // namespace cnerf
