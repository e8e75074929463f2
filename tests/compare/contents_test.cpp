// What tells a file's content from another's under its name, as cells of a comparison remember it.

#include "src/compare/contents.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>
#include <string>

#include "src/base/files.h"
#include "tests/support/data.h"

namespace cnerf::compare {
namespace {

std::string of_spec(const std::string& spec, const std::filesystem::path& folder) {
  ColorizerOptions options;
  options.spec = spec;
  return content_of_spec(options, folder);
}

TEST(Contents, OfANetworkAreAlsoItsContracts) {
  const test::TempDir folder;
  const auto network = [&] { return of_spec("onnx:net.onnx", folder.path()); };
  EXPECT_EQ(network(), "") << "who reads it says that it is missing";
  write_file(folder / "net.onnx", std::string("one"));
  const std::string first = network();
  write_file(folder / "net.onnx", std::string("other"));
  const std::string second = network();
  write_file(folder / "net.onnx.toml", std::string("size = 128"));
  const std::string third = network();
  write_file(folder / "net.onnx.toml", std::string("size = 256"));
  EXPECT_NE(first, "");
  EXPECT_NE(second, first);
  EXPECT_NE(third, second);
  EXPECT_NE(network(), third);
}

TEST(Contents, OfReferencesAreAllFilesOfTheirFolder) {
  const test::TempDir folder;
  write_file(folder / "references/a, b.png", std::string("one"));
  const auto photographs = [&] { return of_spec("reference:references", folder.path()); };
  const std::string alone = photographs();
  write_file(folder / "references/c.png", std::string("other"));
  EXPECT_NE(alone, "");
  EXPECT_NE(photographs(), alone);
  EXPECT_EQ(of_spec("reference:references/a, b.png", folder.path()), alone) << "names may hold commas";
  EXPECT_EQ(of_spec("reference:references/a, b.png,references/c.png", folder.path()), photographs());
}

TEST(Contents, OfWhatNamesNoFileAreNone) {
  const test::TempDir folder;
  write_file(folder / "grey/view.png", std::string("a photograph of the capture"));
  EXPECT_EQ(of_spec("grey", folder.path()), "");
  EXPECT_EQ(of_spec("exec:python3 colorize.py", folder.path()), "");
}

TEST(Contents, OfTheBuiltinNetworkAreThoseOfTheWeightsInUse) {
  constexpr const char* kName = "CNERF_COLORIZER_WEIGHTS";
  const char* set = std::getenv(kName);
  const auto before = set != nullptr ? std::optional<std::string>(set) : std::nullopt;
  const test::TempDir folder;
  write_file(folder / "mine.weights", std::string("mine"));
  ::setenv(kName, (folder / "mine.weights").c_str(), 1);
  const std::string mine = content_of_builtin();
  ::unsetenv(kName);
  const std::string own = content_of_builtin();
  if (before) ::setenv(kName, before->c_str(), 1);
  EXPECT_EQ(mine, content_of(folder / "mine.weights"));
  EXPECT_NE(own, mine);
}

}  // namespace
}  // namespace cnerf::compare
