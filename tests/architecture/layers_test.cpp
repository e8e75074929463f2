/// Layers that stand in a document only leak. This test reads the #include lines of the sources and refuses an upward
/// one, colour truth where training is, and Torch where it does not belong.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "src/base/files.h"

namespace cnerf {
namespace {
namespace fs = std::filesystem;

/// From the bottom to the top, as add_subdirectory has them in the root CMakeLists.txt; a file may include its own
/// folder and those before it.
const std::vector<std::string> kLayers = {"src/base",
                                          "src/cluster",
                                          "src/color",
                                          "src/picture",
                                          "src/capture",
                                          "src/sample",
                                          "encoding",
                                          "src/optim",
                                          "src/field",
                                          "src/render",
                                          "src/engine",
                                          "src/colorizer",
                                          "src/colorizer_training",
                                          "src/train/luminance",
                                          "src/prepare",
                                          "src/train/chroma",
                                          "src/train",
                                          "src/evaluate",
                                          "bake",
                                          "bake/lattice",
                                          "bake/out_of_core",
                                          "bake/density",
                                          "bake/visibility",
                                          "bake/color",
                                          "bake/volume",
                                          "bake/mesh",
                                          "bake/splat",
                                          "bake/job",
                                          "export",
                                          "viewer",
                                          "src/config",
                                          "src/pipeline",
                                          "src/studio",
                                          "src/compare",
                                          "src/python",
                                          "src/app"};

constexpr const char* kColorTruth = "color_truth.h";
const std::vector<std::string> kReadersOfColor = {"src/capture", "src/evaluate", "src/compare"};

struct Include {
  std::string file;    ///< relative to the root
  std::string target;  ///< as written
};

std::optional<std::size_t> layer_of(const std::string& path) {
  std::optional<std::size_t> found;
  for (std::size_t i = 0; i < kLayers.size(); ++i) {
    const bool is_longer = !found || kLayers[i].size() > kLayers[*found].size();
    if (path.starts_with(kLayers[i] + "/") && is_longer) found = i;
  }
  return found;
}

std::vector<Include> includes_of(const std::string& file, const std::string& text) {
  static const std::regex pattern(R"re(^\s*#\s*include\s*["<]([^">]+)[">])re");
  std::vector<Include> includes;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.find("include") == std::string::npos) continue;  // a regex on every line is slow
    std::smatch match;
    if (std::regex_search(line, match, pattern)) includes.push_back({file, match[1]});
  }
  return includes;
}

bool is_source(const fs::path& path) {
  const std::string extension = path.extension().string();
  for (const char* known : {".h", ".cpp", ".inl", ".cu", ".cuh"}) {
    if (extension == known) return true;
  }
  return false;
}

std::vector<Include> all_includes() {
  const fs::path root = CNERF_SOURCE_DIR;
  std::vector<Include> all;
  for (const char* folder : {"src", "encoding", "bake", "export", "viewer/server"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      if (!entry.is_regular_file() || !is_source(entry.path())) continue;
      const std::string file = fs::relative(entry.path(), root).generic_string();
      const auto includes = includes_of(file, read_text_file(entry.path()));
      all.insert(all.end(), includes.begin(), includes.end());
    }
  }
  return all;
}

bool points_up(const Include& include) {
  const auto from = layer_of(include.file), to = layer_of(include.target);
  return from && to && *to > *from;
}

bool leaks_truth(const Include& include) {
  const bool may_read = std::ranges::any_of(
      kReadersOfColor, [&](const std::string& folder) { return include.file.starts_with(folder + "/"); });
  return !may_read && include.target.ends_with(kColorTruth);
}

bool misplaces_torch(const Include& include) {
  const bool is_torch =
      include.target.starts_with("torch/") || include.target.starts_with("ATen/") || include.target.starts_with("c10/");
  const bool is_allowed =
      include.file.find("/torch/") != std::string::npos || include.file.starts_with("src/colorizer_training/");
  return is_torch && !is_allowed;
}

std::string offenders(bool (*rule)(const Include&)) {
  std::string text;
  for (const Include& include : all_includes()) {
    if (rule(include)) text += include.file + " includes " + include.target + "\n";
  }
  return text;
}

TEST(Architecture, IncludesPointDown) {
  EXPECT_EQ(offenders(points_up), "");
}

TEST(Architecture, OnlyEvaluationSeesColour) {
  EXPECT_EQ(offenders(leaks_truth), "");
}

TEST(Architecture, TorchStaysWhereItBelongs) {
  EXPECT_EQ(offenders(misplaces_torch), "");
}

TEST(Architecture, EverySourceLiesInALayer) {
  for (const Include& include : all_includes()) {
    EXPECT_TRUE(layer_of(include.file).has_value()) << include.file << " is in no layer of this test";
  }
  EXPECT_GT(all_includes().size(), 100u) << "the sources were not found";
}

/// The rooms that the first column of the table in a document names, from the top.
std::vector<std::string> rooms_of(const std::string& markdown) {
  static const std::regex row(R"re((?:^|\n)\| `([\w/]+)`)re");
  const std::string table = markdown.substr(0, markdown.find("\n## Devices"));
  std::vector<std::string> rooms;
  for (std::sregex_iterator at(table.begin(), table.end(), row), end; at != end; ++at) rooms.push_back((*at)[1]);
  return rooms;
}

TEST(Architecture, TheDocumentNamesEveryRoomInOrder) {
  std::vector<std::string> expected = kLayers;
  std::erase_if(expected, [](const std::string& layer) { return layer.starts_with("bake/"); });  // one row for all
  EXPECT_EQ(rooms_of(read_text_file(fs::path(CNERF_SOURCE_DIR) / "docs/architecture.md")), expected);
}

/// The rules themselves can fail.
TEST(Architecture, RulesRecogniseWhatTheyForbid) {
  const auto upward = includes_of("src/base/error.h", "  #  include \"src/train/scene.h\"\n");
  ASSERT_EQ(upward.size(), 1u);
  EXPECT_TRUE(points_up(upward[0]));
  EXPECT_FALSE(points_up({"src/train/stage1.cpp", "src/base/error.h"}));
  EXPECT_FALSE(points_up({"src/train/stage1.cpp", "vector"}));
  EXPECT_TRUE(points_up({"bake/volume/bake_volumes.cpp", "export/vdb_writer.h"}));
  EXPECT_TRUE(leaks_truth({"src/train/stage2.cpp", "src/capture/color_truth.h"}));
  EXPECT_TRUE(leaks_truth({"src/colorizer/colorizer.cpp", "src/capture/color_truth.h"}));
  EXPECT_FALSE(leaks_truth({"src/evaluate/evaluate.cpp", "src/capture/color_truth.h"}));
  EXPECT_TRUE(misplaces_torch({"src/train/stage2.cpp", "torch/torch.h"}));
  EXPECT_TRUE(misplaces_torch({"src/compare/methods.cpp", "torch/torch.h"}));
  EXPECT_FALSE(misplaces_torch({"src/colorizer/torch/network.cpp", "torch/torch.h"}));
  EXPECT_TRUE(misplaces_torch({"src/colorizer/colorizer.cpp", "torch/torch.h"}));
  EXPECT_FALSE(misplaces_torch({"src/compare/baselines/torch/positional_engines.cpp", "torch/torch.h"}));
}

}  // namespace
}  // namespace cnerf
