#include "src/compare/contents.h"

#include <algorithm>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "src/base/files.h"
#include "src/colorizer/kinds.h"
#include "src/colorizer/weights_content.h"

namespace cnerf::compare {
namespace fs = std::filesystem;
namespace {

/// None where it names none, as a command does, or where one is missing, which who makes the colorizer says.
std::vector<fs::path> files_of_spec(const ColorizerOptions& options, const fs::path& folder) {
  const std::size_t colon = options.spec.find(':');
  if (colon == std::string::npos) return {};
  ColorizerContext context;
  context.working_folder = folder;
  try {
    return find_spec_files({options.spec.substr(colon + 1), options, context});
  } catch (const std::runtime_error&) {
    return {};
  }
}

}  // namespace

std::string content_of(const fs::path& place) {
  std::error_code failure;
  if (fs::is_regular_file(place, failure)) return sha256_of_file(place);
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(place, failure)) {
    if (entry.is_regular_file(failure)) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  std::string contents;
  for (const fs::path& file : files) contents += sha256_of_file(file);
  return contents;
}

std::string content_of_spec(const ColorizerOptions& options, const fs::path& folder) {
  std::string contents;
  for (const fs::path& file : files_of_spec(options, folder)) {
    contents += content_of(file) + content_of(file.string() + ".toml");
  }
  return contents;
}

std::string content_of_builtin() {
  const std::vector<fs::path> places = builtin_weights_places();
  std::error_code failure;
  const auto found = std::ranges::find_if(places, [&](const fs::path& place) { return fs::exists(place, failure); });
  return found == places.end() ? "" : content_of(*found);
}

}  // namespace cnerf::compare
