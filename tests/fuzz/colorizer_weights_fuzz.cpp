/// Weights of the built-in colorizer: the file as it is, or its content, packed and with its checksum.

#include "src/base/files.h"
#include "src/base/gzip.h"
#include "src/colorizer/weights_content.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

std::vector<std::byte> packed(std::string_view magic, cnerf::fuzz::Bytes content) {
  std::vector<std::uint8_t> sorted;
  for (const std::size_t first : {0, 1}) {
    for (std::size_t i = first; i < content.size(); i += 2) sorted.push_back(std::to_integer<std::uint8_t>(content[i]));
  }
  std::vector<std::byte> file;
  cnerf::fuzz::append_bytes(file, cnerf::fuzz::bytes_of(magic));
  cnerf::fuzz::append_bytes(file, cnerf::fuzz::bytes_of(cnerf::sha256(content)));
  cnerf::fuzz::append_bytes(file, cnerf::gzip(sorted));
  return file;
}

}  // namespace

CNERF_FUZZ_TARGET(colorizer_weights) {
  const auto kind = cnerf::fuzz::take_byte(input) % 3;
  std::vector<std::byte> content;
  if (kind == 1) content = packed(cnerf::kWeightsMagicWithoutEncoder, input);
  if (kind == 2) content = packed(cnerf::kWeightsMagic, input);
  const auto file = cnerf::fuzz::scratch_file("net.weights", kind == 0 ? input : cnerf::fuzz::Bytes(content));
  cnerf::fuzz::read_or_refuse(file, [&] { return cnerf::read_weights_content(file); });
}
