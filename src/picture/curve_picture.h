#pragma once
/// Curves over numbered things, as pictures.

#include <optional>
#include <span>

#include "src/picture/picture.h"

namespace cnerf {

/// Values from left to right, joined by lines. The picture's height is what they span, `level` included.
/// @param level  drawn as a grey line across, if given
[[nodiscard]] Picture curve_picture(std::span<const double> values, std::optional<double> level, int width, int height);

}  // namespace cnerf
