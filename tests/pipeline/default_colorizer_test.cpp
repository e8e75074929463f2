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
  EXPECT_EQ(chosen(), "reference:references") << "wherever the capture is moved";
}

TEST_F(DefaultColorizer, PhotographsBesideWhatIsYetToBePreparedKeepTheirPlace) {
  write_file(capture_ / "references/a.png", "pixels");
  write_file(capture_ / "images/view.png", "pixels");
  EXPECT_EQ(chosen(), "reference:" + (capture_ / "references").string());
}

TEST_F(DefaultColorizer, WhatIsGivenStays) {
  write_file(capture_ / "references/a.png", "pixels");
  EXPECT_EQ(chosen("exec:paint"), "exec:paint");
}

/// Works in another folder as long as it lives.
class CurrentFolder {
 public:
  explicit CurrentFolder(const std::filesystem::path& folder) { std::filesystem::current_path(folder); }
  ~CurrentFolder() { std::filesystem::current_path(before_); }
  CurrentFolder(const CurrentFolder&) = delete;
  CurrentFolder& operator=(const CurrentFolder&) = delete;

 private:
  std::filesystem::path before_ = std::filesystem::current_path();
};

TEST_F(DefaultColorizer, FilesOfTheCurrentFolderAreFoundFromAnyFolder) {
  const test::TempDir folder;
  for (const char* name : {"a.png", "b, c.png", "net.onnx", "painted/both.png"}) write_file(folder / name, "pixels");
  write_file(capture_ / "painted/both.png", "pixels");
  const CurrentFolder current(folder.path());
  const std::string here = std::filesystem::current_path().string() + "/";
  EXPECT_EQ(chosen("reference:a.png"), "reference:" + here + "a.png");
  EXPECT_EQ(chosen("reference:a.png,b, c.png"), "reference:" + here + "a.png," + here + "b, c.png");
  EXPECT_EQ(chosen("onnx:net.onnx"), "onnx:" + here + "net.onnx");
  EXPECT_EQ(chosen("reference:painted/both.png"), "reference:painted/both.png") << "of the capture";
  EXPECT_EQ(chosen("reference:" + here + "a.png"), "reference:" + here + "a.png");
  for (const char* as_it_is : {"reference:absent.png", "exec:a.png", "builtin", "zebra:a.png", "reference:"}) {
    EXPECT_EQ(chosen(as_it_is), as_it_is);
  }
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
