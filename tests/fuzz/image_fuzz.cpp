/// PNG and JPEG pictures: their headers, and where these are of no large one, their pixels and what is made of them.

#include "src/capture/image_io.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(image) {
  using namespace cnerf;
  constexpr std::int64_t kMostDecoded = 1 << 20;  // pixels; more takes time and shows nothing new
  const auto file = fuzz::scratch_file("picture.png", input);
  fuzz::read_or_refuse(file, [&] {
    const auto header = stated_header(file);
    if (!header || std::int64_t(header->width) * header->height > kMostDecoded) return;
    const LinearImage image = read_linear_image(file, Transfer::kSrgb);
    if (image.values.size() != image.pixel_count() * std::size_t(image.channels)) {
      throw fuzz::Finding("a picture has another number of values than pixels");
    }
    (void)is_monochrome(image);
    (void)encode_mono(luminance_image(image), Transfer::kSrgb);
    (void)read_mask(file, image.width, image.height);
  });
}
