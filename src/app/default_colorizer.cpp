#include "src/app/default_colorizer.h"

#include "src/base/error.h"

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
  throw UsageError(
      "no colorizer: say where colours come from with one of\n"
      "  --colorizer reference:PHOTO.jpg        a colour photograph of the scene or of one like it\n"
      "  --colorizer torchscript:MODEL.pt       a colorizing network as TorchScript (runs code of that file)\n"
      "  --colorizer 'exec:python3 my_model.py' any program that colours patches over a pipe\n"
      "  --grey                                 none: train and bake without colour");
}

}  // namespace cnerf
