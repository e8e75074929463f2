/// What Khronos' validator says of our files.

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <optional>

#include "export/bake_folder.h"
#include "src/base/files.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/whole_bake.h"
#include "tests/export/test_meshes.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
using namespace bake::test;
namespace {
namespace fs = std::filesystem;

/// node_modules with the validator: under $CNERF_NODE_MODULES, else where scripts/install_dependencies.sh puts it.
std::optional<fs::path> node_modules() {
  const char* given = std::getenv("CNERF_NODE_MODULES");
  const fs::path folder = given != nullptr ? fs::path(given) : fs::path(CNERF_SOURCE_DIR) / "build/node/node_modules";
  if (!fs::exists(folder / "gltf-validator") || std::system("node --version > /dev/null 2>&1") != 0)
    return std::nullopt;
  return folder;
}

#define CNERF_REQUIRE_VALIDATOR() \
  if (!node_modules()) GTEST_SKIP() << "needs node and gltf-validator: bash scripts/install_dependencies.sh --tests"

/// Exit status of the validator; what it said is left in `log`.
int validate(const std::vector<fs::path>& files, const fs::path& log) {
  std::string command =
      "node '" + std::string(CNERF_SOURCE_DIR) + "/tests/gltf/validate.js' '" + node_modules()->string() + "'";
  for (const fs::path& file : files) command += " '" + file.string() + "'";
  const int status = std::system((command + " > '" + log.string() + "' 2>&1").c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(GltfValidator, ABakedMeshHasNoErrorsAndNoWarnings) {
  CNERF_REQUIRE_VALIDATOR();
  const TempDir folder;
  const AnalyticField field({{1, 2, 3}, 0.5, 1}, sphere_density({0.5f, 0.5f, 0.5f}, 0.3f, 600), 0.4f, {1.1f, 0.8f});
  const std::vector<bake::Camera> cameras{camera_at("a b/ä.png", {6, 2, 3}, {1, 2, 3}, 64, 48, 100),
                                          camera_at("b", {1, 7, 3}, {1, 2, 3}, 32, 48, 90)};
  bake::Options options;
  options.resolution = 32;
  bake::MeshOptions mesh_options;
  mesh_options.faces = 800;
  mesh_options.texture_size = 200;  // not a power of two
  const bake::Mesh mesh = bake_mesh(field, cameras, options, mesh_options);
  BakeFolder bake(folder.path(), cameras, {{"reference:\"a\".png", "first", {"cnerf", "bake"}}, {}});
  const GltfFiles files = bake.add_mesh(mesh, "mesh", true);
  EXPECT_EQ(validate({files.gltf, files.glb}, folder / "log"), 0) << read_text_file(folder / "log");
}

/// The check can fail: bounds of positions that are wrong, and a file that refers to a picture that is not there.
TEST(GltfValidator, NoticesWhatIsWrong) {
  CNERF_REQUIRE_VALIDATOR();
  const TempDir folder;
  BakeFolder bake(folder.path(), {}, {});
  const GltfFiles files = bake.add_mesh(tetrahedron(), "mesh", true);
  EXPECT_EQ(validate({files.gltf, files.glb}, folder / "log"), 0) << read_text_file(folder / "log");
  std::string text = read_text_file(files.gltf);
  const std::size_t maximum = text.find("\"max\"");
  text.replace(text.find("6.0", maximum), 3, "5.0");
  write_file(folder / "bounds.gltf", std::string_view(text));
  EXPECT_NE(validate({folder / "bounds.gltf"}, folder / "log"), 0) << read_text_file(folder / "log");
  fs::remove(files.basecolor);
  EXPECT_NE(validate({files.gltf}, folder / "log"), 0) << read_text_file(folder / "log");
}

}  // namespace
}  // namespace cnerf::exporting::test
