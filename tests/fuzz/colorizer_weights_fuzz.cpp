/// Weights of the built-in colorizer: the file as it is, or its content, packed and with its checksum.

#include "src/base/files.h"
#include "src/base/gzip.h"
#include "src/colorizer/weights_content.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

std::vector<std::byte> packed(cnerf::fuzz::Bytes content) {
  std::vector<std::uint8_t> sorted;
  for (const std::size_t first : {0, 1}) {
    for (std::size_t i = first; i < content.size(); i += 2) sorted.push_back(std::to_integer<std::uint8_t>(content[i]));
  }
  std::vector<std::byte> file;
  cnerf::fuzz::append_bytes(file, cnerf::fuzz::bytes_of("CNERFCW3"));
  cnerf::fuzz::append_bytes(file, cnerf::fuzz::bytes_of(cnerf::sha256(content)));
  cnerf::fuzz::append_bytes(file, cnerf::gzip(sorted));
  return file;
}

}  // namespace

CNERF_FUZZ_TARGET(colorizer_weights) {
  const bool is_content = cnerf::fuzz::take_byte(input) % 2 == 1;
  const auto file = is_content ? cnerf::fuzz::scratch_file("net.weights", packed(input))
                               : cnerf::fuzz::scratch_file("net.weights", input);
  cnerf::fuzz::read_or_refuse(file, [&] { return cnerf::read_weights_content(file); });
}
