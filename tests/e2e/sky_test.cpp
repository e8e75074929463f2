/// A capture with a sky, from its photographs to files.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "src/base/files.h"
#include "src/capture/exr_io.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

const fs::path& outdoors() {
  static const TempDir folder;
  static const bool made = [] {
    const auto arguments = [](const std::string& options) {
      std::vector<std::string> words{"sample", "-o", (folder / "capture").string()};
      std::istringstream list(options);
      for (std::string word; list >> word;) words.push_back(word);
      return words;
    };
    return cnerf(arguments("--sky --views 12 --width 96 --height 72 --samples-per-pixel 4")).exit_code == 0;
  }();
  EXPECT_TRUE(made);
  static const fs::path capture = folder / "capture";
  return capture;
}

std::vector<std::string> training(const fs::path& run) {
  return concatenated({"train", outdoors().string(), "-o", run.string(), "--progress", "json"}, tiny_options());
}

TEST(Sky, IsTrainedColouredAndBaked) {
  const TempDir folder;
  const fs::path run = folder / "run";
  ASSERT_EQ(cnerf(training(run)).exit_code, 0);
  EXPECT_THAT(
      cnerf({"info", run.string()}).out,
      testing::AllOf(HasSubstr("sky:"), testing::ContainsRegex("sky seen: +[0-9]+ % of the pixels, in [0-9]+ views"),
                     HasSubstr("exposure curve:")));
  // Enough steps for a colour that is looked for below.
  const ProgramResult colored = cnerf({"colorize", run.string(), "--take", "warm", "--colorizer",
                                       "reference:" + (outdoors() / "references").string(), "--set",
                                       "colorizer.reference_steps=20", "--set", "stage2.distill_steps=10"});
  ASSERT_EQ(colored.exit_code, 0) << colored.err;
  const fs::path bake = folder / "bake";
  const ProgramResult baked = cnerf({"bake", run.string(), "--take", "warm", "--format", "vdb,gltf,web", "-o",
                                     bake.string(), "--web-resolution", "24", "--faces", "500"});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;

  const LinearImage sky = read_exr(bake / "sky.exr");
  ASSERT_EQ(sky.channels, 3);
  ASSERT_EQ(sky.width, 2 * sky.height);
  const auto pixel = [&](int x, int y) {
    return &sky.values[3 * (std::size_t(y) * std::size_t(sky.width) + std::size_t(x))];
  };
  for (int x = 0; x < sky.width; x += 16) {
    const float* rgb = pixel(x, sky.height * 2 / 5);  // 18 degrees up, where the cameras look
    EXPECT_GT(0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2], 0.35f) << x;
    EXPECT_GT(std::abs(rgb[2] - rgb[0]), 0.02f) << x << ": it has what the colorizer said of it";
  }
  const auto manifest = nlohmann::json::parse(read_text_file(bake / "manifest.json"));
  EXPECT_EQ(manifest.at("sky").at("file"), "sky.exr");
  EXPECT_THAT(read_text_file(bake / "mesh.gltf"), HasSubstr("sky.exr"));
  const auto bundle = nlohmann::json::parse(read_text_file(bake / "web" / "bundle.json"));
  EXPECT_EQ(bundle.at("sky").at("file"), "sky.jpg");
  EXPECT_TRUE(fs::exists(bake / "web" / "sky.jpg"));
}

TEST(Sky, AStoppedTrainingGoesOnToTheSameBytes) {
  const TempDir folder;
  ASSERT_EQ(cnerf(training(folder / "whole")).exit_code, 0);
  const ProgramResult stopped = cnerf_interrupted_at(training(folder / "parts"), "\"progress\"");
  if (stopped.exit_code == 0) GTEST_SKIP() << "the program was done before the signal arrived";
  ASSERT_EQ(cnerf(concatenated(training(folder / "parts"), {"--resume", "--threads", "1"})).exit_code, 0);
  EXPECT_TRUE(read_binary_file(folder / "parts/stage1.snapshot") == read_binary_file(folder / "whole/stage1.snapshot"));
}

TEST(Sky, CanBeSwitchedOff) {
  const TempDir folder;
  ASSERT_EQ(cnerf(concatenated(training(folder / "run"), {"--set", "stage1.sky=false"})).exit_code, 0);
  EXPECT_THAT(cnerf({"info", (folder / "run").string()}).out, testing::Not(HasSubstr("sky:")));
}

/// The sample capture cuts its objects out.
TEST(Sky, IsNoneWhereNoViewSeesOne) {
  EXPECT_THAT(cnerf({"info", tiny_run().string()}).out, testing::Not(HasSubstr("sky:")));
  EXPECT_THAT(files_below(tiny_bake()), testing::Not(testing::Contains("sky.exr")));
}

}  // namespace
}  // namespace cnerf::test
