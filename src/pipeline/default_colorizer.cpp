#include "src/pipeline/default_colorizer.h"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "src/base/error.h"
#include "src/base/text.h"
#include "src/colorizer/kinds.h"
#include "src/pipeline/known_color_files.h"
#include "src/prepare/prepare.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

/// Where a colorizer looks for files first: in the capture. Empty where that is yet to be prepared, elsewhere.
fs::path home_of_files(const fs::path& capture) {
  if (prepare::needs_preparing(capture)) return {};
  const fs::path place = fs::absolute(capture);
  return fs::is_directory(place) ? place : place.parent_path();
}

/// Files that are found in the current folder, and not in `home`, get names that lead to them from any folder. What is
/// not found is refused where it is read.
void make_spec_absolute(ColorizerOptions& config, const fs::path& home) {
  constexpr std::array<std::string_view, 4> kKindsOfFiles = {"reference", "torchscript", "onnx", "caffe"};
  const auto colon = config.spec.find(':');
  const std::string kind = config.spec.substr(0, colon);
  if (colon == std::string::npos || std::ranges::count(kKindsOfFiles, std::string_view(kind)) == 0) return;
  ColorizerContext context;
  context.working_folder = home;
  std::vector<fs::path> files;
  try {
    files = find_spec_files({config.spec.substr(colon + 1), config, context});
  } catch (const MissingInputError&) {
    return;
  }
  if (std::ranges::none_of(files, [](const fs::path& file) { return file.is_relative(); })) return;
  std::vector<std::string> names;
  for (const fs::path& file : files) names.push_back(fs::absolute(file).string());
  const auto has_comma = [](const std::string& name) { return name.find(',') != std::string::npos; };
  if (kind == "caffe" && std::ranges::any_of(names, has_comma)) return;  // it parts its files at the first one
  config.spec = kind + ":" + joined(names, ",");
}

/// @param folder  of what is coloured
/// @param home    see home_of_files
void choose(const fs::path& folder, const fs::path& home, Config& config, Observer& observer) {
  make_files_absolute(config.colorizer);
  if (!config.colorizer.spec.empty()) return make_spec_absolute(config.colorizer, home);
  if (!config.colorizer.keyframes.empty()) {
    for (const fs::path& file : key_frame_files(config.colorizer)) {
      config.colorizer.spec += (config.colorizer.spec.empty() ? "reference:" : ",") + fs::absolute(file).string();
    }
    observer.say("no --colorizer given: what no key frame shows gets colours like theirs");
    return;
  }
  const fs::path references = folder / "references";
  if (fs::is_directory(references)) {
    // By a name that stays true where the capture is moved, if it is that one.
    config.colorizer.spec =
        "reference:" + (home.empty() ? fs::absolute(references).lexically_normal().string() : "references");
    observer.say("no --colorizer given: colours come from the photographs in " + references.string());
    return;
  }
  config.colorizer.spec = "builtin";
  observer.say(
      "no --colorizer given: the built-in network guesses colours; --colorizer reference:PHOTO.jpg takes those of a "
      "photograph");
}

}  // namespace

void choose_colorizer(const fs::path& source, Config& config, Observer& observer) {
  choose(fs::is_directory(source) ? source : source.parent_path(), home_of_files(source), config, observer);
}

void choose_colorizer(const Capture& capture, Config& config, Observer& observer) {
  choose(capture.root, fs::absolute(capture.root), config, observer);
}

void prefer_key_frames(const ColorizerOptions& named, ColorizerOptions& of_run) {
  if (!named.keyframes.empty() && named.spec.empty()) of_run.spec.clear();
}

}  // namespace cnerf::pipeline
