#pragma once
/// The colours of a capture's images, for evaluation and for references the user names. Training code does not include
/// this header (tests/architecture proves it), and a Capture holds no colour: that is how colour cannot leak.

#include <optional>
#include <vector>

#include "src/capture/capture.h"

namespace cnerf {

/// Linear Rec.709 RGB, [H, W, 3] interleaved, composited over black.
struct ColorImage {
  int width = 0, height = 0;
  std::vector<float> rgb;
};

/// The colours of one view at the size of `view.image`; nothing when its file is monochrome.
[[nodiscard]] std::optional<ColorImage> load_color_truth(const View& view);

/// Any colour image file, at full size.  @throws MissingInputError, InputError.
[[nodiscard]] ColorImage load_color_image(const std::filesystem::path& file);

}  // namespace cnerf
