#include "src/base/error.h"
#include "src/colorizer/kinds.h"

namespace cnerf {

std::filesystem::path find_spec_file(const std::string& name, const ColorizerRequest& request) {
  const std::filesystem::path& folder = request.context.working_folder;
  const std::filesystem::path beside = folder / name;
  if (!folder.empty() && std::filesystem::exists(beside)) return beside;
  if (std::filesystem::exists(name)) return name;
  std::string message = "colorizer \"" + request.options.spec + "\": no file " + name;
  if (!folder.empty() && beside != name) message += ", nor " + beside.string();
  throw MissingInputError(message);
}

}  // namespace cnerf
