/// cameras.bin, images.bin and points3D.bin of one input: two numbers of 16 bits, the sizes of the first two, then all.

#include <algorithm>
#include <cstdint>

#include "src/capture/listing.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(colmap_binary) {
  using namespace cnerf::fuzz;
  std::uint16_t sizes[2] = {};
  if (!input.empty()) std::memcpy(sizes, input.data(), std::min(input.size(), sizeof sizes));
  Bytes rest = input.subspan(std::min(input.size(), sizeof sizes));
  const char* names[] = {"binary/cameras.bin", "binary/images.bin", "binary/points3D.bin"};
  for (int i = 0; i < 3; ++i) {
    const std::size_t size = i < 2 ? std::min<std::size_t>(sizes[i], rest.size()) : rest.size();
    (void)scratch_file(names[i], rest.first(size));
    rest = rest.subspan(size);
  }
  const auto folder = scratch_folder() / "binary";
  read_or_refuse(folder, [&] { return cnerf::read_colmap(scratch_folder(), folder); });
  read_or_refuse(folder, [&] { return cnerf::colmap_image_count(folder); });
}
