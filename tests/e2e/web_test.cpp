/// Web bundles and cnerf view, as far as no browser is needed.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "src/base/files.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

TEST(Web, ABakeForBrowsersIsABundleWithPhotographs) {
  const TempDir folder;
  const fs::path bake = folder / "bake";
  const std::vector<std::string> arguments{
      "bake",        tiny_run().string(), "--format", "web",       "-o",
      bake.string(), "--web-resolution",  "24",       "--capture", (tiny_capture() / "").string()};
  const ProgramResult result = cnerf(arguments);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("graphics memory")) << "what the browser will need";
  EXPECT_THAT(result.out, HasSubstr("cnerf view")) << "and what to do is said";
  const auto json = nlohmann::json::parse(read_text_file(bake / "web" / "bundle.json"));
  EXPECT_EQ(json.at("title"), tiny_capture().filename().string()) << "with a slash at the end of its path too";
  EXPECT_EQ(json.at("cameras").size(), 9u);
  for (const auto& file : json.at("files")) {
    const auto content = read_binary_file(bake / "web" / file.at("name").get<std::string>());
    EXPECT_EQ(sha256(content), file.at("sha256").get<std::string>());
  }
  EXPECT_TRUE(fs::exists(bake / "web" / "photos" / "008.jpg"));
  const auto bricks = json.at("levels").at(0).at("bricks").get<std::vector<int>>();
  EXPECT_LE(*std::ranges::max_element(bricks), 5) << "24 voxels, their margin, and a voxel around";
  EXPECT_FALSE(fs::exists(bake / "manifest.json")) << "no volume for Blender was asked for";
  EXPECT_EQ(cnerf(arguments).exit_code, 64) << "it is not overwritten";
  EXPECT_EQ(cnerf({"bake", tiny_run().string(), "--format", "vdb,web", "-o", bake.string()}).exit_code, 64);
}

TEST(Web, ViewMakesTheBundleOfABakeAndEndsWithCtrlC) {
  const TempDir folder;
  const fs::path bake = copied(tiny_bake(), folder / "bake");
  EXPECT_FALSE(fs::exists(bake / "web"));
  const ProgramResult shown = cnerf_interrupted_at({"view", bake.string(), "--no-browser"}, "Ctrl-C ends it");
  if (shown.err.find("page was not built") != std::string::npos) GTEST_SKIP() << "the page is not built";
  EXPECT_EQ(shown.exit_code, 0) << shown.err;
  EXPECT_THAT(shown.out, HasSubstr("view: http://127.0.0.1:"));
  EXPECT_TRUE(fs::exists(bake / "web" / "bundle.json"));
}

TEST(Web, ViewShowsTheBundleThatABakeOfSeveralFormatsMade) {
  const TempDir folder;
  const fs::path bake = folder / "bake";
  const ProgramResult baked = cnerf({"bake", tiny_run().string(), "--format", "gltf,vdb,web", "--resolution", "24",
                                     "--web-resolution", "24", "-o", bake.string()});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  const std::string bundle = read_text_file(bake / "web" / "bundle.json");
  const ProgramResult shown = cnerf_interrupted_at({"view", bake.string(), "--no-browser"}, "Ctrl-C ends it");
  if (shown.err.find("page was not built") != std::string::npos) GTEST_SKIP() << "the page is not built";
  EXPECT_EQ(shown.exit_code, 0) << shown.err;
  EXPECT_EQ(read_text_file(bake / "web" / "bundle.json"), bundle) << "it is not made anew, without photographs";
}

TEST(Web, WhatCannotBeShownIsSaidByName) {
  const TempDir folder;
  EXPECT_EQ(cnerf({"view", (folder / "nothing").string()}).exit_code, 66);
  const ProgramResult capture = cnerf({"view", tiny_capture().string()});
  EXPECT_EQ(capture.exit_code, 66);
  EXPECT_THAT(capture.err, HasSubstr("bundle.json"));
  const ProgramResult run = cnerf({"view", tiny_run().string()});
  EXPECT_EQ(run.exit_code, 66);
  EXPECT_THAT(run.err, HasSubstr("cnerf bake"));
  const ProgramResult open = cnerf({"view", tiny_run().string(), "--host", "0.0.0.0"});
  EXPECT_EQ(open.exit_code, 64);
  EXPECT_THAT(open.err, HasSubstr("--token"));
  write_file(folder / "bad" / "manifest.json", std::string_view("{\"schema\": 1"));
  const ProgramResult damaged = cnerf({"view", (folder / "bad").string()});
  EXPECT_EQ(damaged.exit_code, 65);
  EXPECT_THAT(damaged.err, HasSubstr("manifest.json"));
  EXPECT_EQ(cnerf({"bake", tiny_run().string(), "--format", "web,webb"}).exit_code, 64);
  const ProgramResult take = cnerf({"view", tiny_bake().string(), "--take", "warm"});
  EXPECT_EQ(take.exit_code, 64);
  EXPECT_THAT(take.err, HasSubstr("--take: is for a run"));
}

TEST(Web, ABakeIsRenderedFromItsVoxels) {
  const TempDir folder;
  const fs::path bake = copied(tiny_bake(), folder / "bake");
  const ProgramResult result = cnerf({"render", bake.string(), "-o", (folder / "out").string()});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::vector<std::string> files = files_below(folder / "out" / "cameras");
  ASSERT_EQ(files.size(), 9u);
  const cv::Mat picture = cv::imread((folder / "out" / "cameras" / files[0]).string());
  EXPECT_EQ(picture.cols, 48);
  EXPECT_GT(cv::mean(picture)[0], 1) << "something is seen";
  EXPECT_EQ(cnerf({"render", bake.string(), "--format", "mp4"}).exit_code, 64);
}

TEST(Web, ABakeIsNotRenderedByWhatOnlyARunHas) {
  const TempDir folder;
  const std::vector<std::string> render = {"render", tiny_bake().string(), "-o", (folder / "out").string()};
  for (const std::vector<std::string>& words :
       std::vector<std::vector<std::string>>{{"--take", "grey"},
                                             {"--capture", tiny_capture().string()},
                                             {"--baked"},
                                             {"--view-averaged"},
                                             {"--path", "turntable"},
                                             {"--path", "orbit"},
                                             {"--set", "render.framse=2"}}) {
    const ProgramResult refused = cnerf(concatenated(render, words));
    EXPECT_EQ(refused.exit_code, 64) << words.back() << ": " << refused.err;
    EXPECT_THAT(refused.err, HasSubstr(words.front()));
  }
  EXPECT_EQ(cnerf(concatenated(render, {"--max-memory", "much"})).exit_code, 64);
  EXPECT_THAT(files_below(folder.path()), testing::IsEmpty());
}

}  // namespace
}  // namespace cnerf::test
