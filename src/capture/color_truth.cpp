#include "src/capture/color_truth.h"

#include "src/base/error.h"
#include "src/capture/image_io.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

ColorImage color_image(LinearImage image) {
  if (image.channels == 3) return {image.width, image.height, std::move(image.values)};
  ColorImage out = {image.width, image.height, {}};
  out.rgb.reserve(3 * image.values.size());
  for (const float v : image.values) out.rgb.insert(out.rgb.end(), {v, v, v});
  return out;
}

/// The same file name in a folder `color` beside that of the grey image.
fs::path sibling_truth(const fs::path& grey_file) {
  return fs::absolute(grey_file).parent_path().parent_path() / "color" / grey_file.filename();
}

}  // namespace

std::optional<ColorImage> load_color_truth(const View& view) {
  LinearImage image = read_linear_image(view.image_file, view.image.transfer);
  if (is_monochrome(image)) {
    const fs::path sibling = sibling_truth(view.image_file);
    if (!fs::exists(sibling)) return std::nullopt;
    image = read_linear_image(sibling, view.image.transfer);
  }
  if (!same_shape(view.image.width, view.image.height, image.width, image.height)) {
    throw InputError(view.image_file, "size", "the colour image has another shape than the grey one");
  }
  image = area_resized(image, view.image.width, view.image.height);
  for (float& value : image.values) value = view.image.evened(value);
  return color_image(std::move(image));
}

ColorImage load_color_image(const fs::path& file) {
  return color_image(read_linear_image(file, Transfer::kSrgb));
}

}  // namespace cnerf
