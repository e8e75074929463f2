/// transforms.json; read_transforms opens no image.

#include "src/capture/listing.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(transforms) {
  const auto file = cnerf::fuzz::scratch_file("transforms.json", input);
  cnerf::fuzz::read_or_refuse(file, [&] { return cnerf::read_transforms(file); });
}
