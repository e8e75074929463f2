#include "export/blender_setup.h"

#include <nlohmann/json.hpp>

#include "src/base/check.h"
#include "src/base/files.h"

namespace cnerf::exporting {
namespace fs = std::filesystem;

fs::path write_blender_setup(const fs::path& folder) {
  const std::string marker = "BAKE_FOLDER = \"\"";
  std::string text = blender_setup_text();
  const std::size_t at = text.find(marker);
  CNERF_CHECK(at != std::string::npos, "blender_setup.py lost its BAKE_FOLDER line");
  // An ASCII JSON string is a Python string literal as well.
  const std::string literal = nlohmann::json(fs::absolute(folder).lexically_normal().string()).dump(-1, ' ', true);
  text.replace(at, marker.size(), "BAKE_FOLDER = " + literal);
  const fs::path target = folder / "blender_setup.py";
  write_file(target, text);
  return target;
}

}  // namespace cnerf::exporting
