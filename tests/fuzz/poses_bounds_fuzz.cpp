/// LLFF's poses_bounds.npy beside two images, and the array alone.

#include "src/capture/listing.h"
#include "src/capture/npy_reader.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(poses_bounds) {
  using namespace cnerf::fuzz;
  for (const char* image : {"llff/images/0.png", "llff/images/1.png"}) {
    if (!std::filesystem::exists(scratch_folder() / image)) (void)scratch_file(image, {});
  }
  const auto file = scratch_file("llff/poses_bounds.npy", input);
  read_or_refuse(file, [&] { return cnerf::read_npy(file); });
  read_or_refuse(file, [&] { return cnerf::read_llff(file, 1); });
}
