#pragma once
/// Where a bake's colours come from.

#include <string>
#include <vector>

namespace cnerf::bake {

struct Provenance {
  std::string colorizer;                  ///< that inferred the colours; empty = grey
  std::string take;                       ///< which colorization of the run
  std::vector<std::string> command_line;  ///< that asked for the bake
};

/// "colour is inferred, by colorizer reference, take warm", or that there is none.
[[nodiscard]] inline std::string color_origin_text(const std::string& colorizer, const std::string& take) {
  if (colorizer.empty()) return "grey: not colorized";
  return "colour is inferred, by colorizer " + colorizer + ", take " + take;
}
[[nodiscard]] inline std::string color_origin_text(const Provenance& provenance) {
  return color_origin_text(provenance.colorizer, provenance.take);
}

}  // namespace cnerf::bake
