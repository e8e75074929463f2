#include "src/pipeline/default_colorizer.h"

#include <gtest/gtest.h>

#include "src/base/files.h"
#include "tests/support/data.h"

namespace cnerf::pipeline {
namespace {

class DefaultColorizer : public testing::Test {
 protected:
  [[nodiscard]] std::string chosen(const std::string& given = "") {
    Config config;
    config.colorizer.spec = given;
    choose_colorizer(capture_.path(), config, observer_);
    return config.colorizer.spec;
  }
  test::TempDir capture_;
  Observer observer_;
};

TEST_F(DefaultColorizer, IsTheBuiltInNetwork) {
  EXPECT_EQ(chosen(), "builtin");
}

TEST_F(DefaultColorizer, IsTheCapturesOwnPhotographsWhereItHasSome) {
  write_file(capture_ / "references/a.png", "pixels");
  EXPECT_EQ(chosen(), "reference:" + (capture_ / "references").string());
}

TEST_F(DefaultColorizer, WhatIsGivenStays) {
  write_file(capture_ / "references/a.png", "pixels");
  EXPECT_EQ(chosen("exec:paint"), "exec:paint");
}

TEST_F(DefaultColorizer, FilesOfKnownColorsAreFoundFromAnyFolder) {
  const std::string here = std::filesystem::current_path().string() + "/";
  for (const char* spec : {"grey", ""}) {
    Config config;
    config.colorizer.spec = spec;
    config.colorizer.keyframes = "a=a.png; b.png=/b=1.png";
    config.colorizer.hint_images = "a=hints/a.png";
    config.colorizer.strokes = "strokes.json";
    choose_colorizer(capture_.path(), config, observer_);
    EXPECT_EQ(config.colorizer.keyframes, "a=" + here + "a.png;b.png=/b=1.png");
    EXPECT_EQ(config.colorizer.hint_images, "a=" + here + "hints/a.png");
    EXPECT_EQ(config.colorizer.strokes, here + "strokes.json");
  }
  Config config;
  choose_colorizer(capture_.path(), config, observer_);
  EXPECT_EQ(config.colorizer.keyframes + config.colorizer.hint_images + config.colorizer.strokes, "");
}

}  // namespace
}  // namespace cnerf::pipeline
