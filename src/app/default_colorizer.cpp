#include "src/app/default_colorizer.h"

namespace cnerf {
namespace fs = std::filesystem;

void choose_colorizer(const fs::path& capture, Config& config, Reporter& reporter) {
  if (!config.colorizer.spec.empty()) return;
  const fs::path folder = fs::is_directory(capture) ? capture : capture.parent_path();
  const fs::path references = folder / "references";
  if (fs::is_directory(references)) {
    config.colorizer.spec = "reference:" + fs::absolute(references).lexically_normal().string();
    reporter.say("no --colorizer given: colours come from the photographs in " + references.string());
    return;
  }
  config.colorizer.spec = "builtin";
  reporter.say(
      "no --colorizer given: the built-in network guesses colours; --colorizer reference:PHOTO.jpg takes those of a "
      "photograph");
}

}  // namespace cnerf
