#include "src/pipeline/default_colorizer.h"

#include "src/pipeline/known_color_files.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;

void choose_colorizer(const fs::path& capture, Config& config, Observer& observer) {
  make_files_absolute(config.colorizer);
  if (!config.colorizer.spec.empty()) return;
  if (!config.colorizer.keyframes.empty()) {
    for (const fs::path& file : key_frame_files(config.colorizer)) {
      config.colorizer.spec += (config.colorizer.spec.empty() ? "reference:" : ",") + fs::absolute(file).string();
    }
    observer.say("no --colorizer given: what no key frame shows gets colours like theirs");
    return;
  }
  const fs::path folder = fs::is_directory(capture) ? capture : capture.parent_path();
  const fs::path references = folder / "references";
  if (fs::is_directory(references)) {
    config.colorizer.spec = "reference:" + fs::absolute(references).lexically_normal().string();
    observer.say("no --colorizer given: colours come from the photographs in " + references.string());
    return;
  }
  config.colorizer.spec = "builtin";
  observer.say(
      "no --colorizer given: the built-in network guesses colours; --colorizer reference:PHOTO.jpg takes those of a "
      "photograph");
}

void prefer_key_frames(const ColorizerOptions& named, ColorizerOptions& of_run) {
  if (!named.keyframes.empty() && named.spec.empty()) of_run.spec.clear();
}

}  // namespace cnerf::pipeline
