#include "export/bake_folder.h"

#include <gtest/gtest.h>

#include "src/base/files.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
namespace {

TEST(BlenderSetup, IsTheScriptOfTheRepositoryWithTheFolderFilledIn) {
  const TempDir folder;
  const auto odd = folder / "with \"quotes\" and \\ and ü and 😀";
  const auto file = write_blender_setup(odd);
  std::string written = read_text_file(file);
  EXPECT_EQ(written.find("BAKE_FOLDER = \"\"\n"), std::string::npos);
  const std::size_t begin = written.find("BAKE_FOLDER = \"") + 14;
  const std::size_t end = written.find('\n', begin);
  const std::string literal = written.substr(begin, end - begin);
  EXPECT_NE(literal.find("with \\\"quotes\\\" and \\\\ and ü and 😀\""), std::string::npos) << literal;
  written.replace(begin, end - begin, "\"\"");
  EXPECT_EQ(written, blender_setup_text());
}

}  // namespace
}  // namespace cnerf::exporting::test
