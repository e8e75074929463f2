/// An OpenEXR picture: its header, and where that is no large one, its pixels.

#include "src/capture/exr_io.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(exr) {
  constexpr std::int64_t kMostDecoded = 1 << 20;  // pixels; more takes time and shows nothing new
  const auto file = cnerf::fuzz::scratch_file("picture.exr", input);
  cnerf::fuzz::read_or_refuse(file, [&] {
    const cnerf::ImageHeader header = cnerf::exr_header(file);
    if (std::int64_t(header.width) * header.height > kMostDecoded) return;
    const cnerf::LinearImage image = cnerf::read_linear_image(file, cnerf::Transfer::kSrgb);
    if (image.width != header.width || image.height != header.height) {
      throw cnerf::fuzz::Finding("the header states another size than the picture has");
    }
  });
}
