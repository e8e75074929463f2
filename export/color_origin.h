#pragma once
/// What every export says about where its colours come from.

#include <string>

namespace cnerf {

/// "colour is inferred, by colorizer reference, take warm", or that there is none.
[[nodiscard]] inline std::string color_origin_text(const std::string& colorizer, const std::string& take) {
  if (colorizer.empty()) return "grey: not colorized";
  return "colour is inferred, by colorizer " + colorizer + ", take " + take;
}

}  // namespace cnerf
