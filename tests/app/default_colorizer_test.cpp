#include "src/app/default_colorizer.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <memory>

#include "src/base/files.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

class DefaultColorizer : public testing::Test {
 protected:
  [[nodiscard]] std::string chosen(const std::string& given = "") {
    Config config;
    config.colorizer.spec = given;
    choose_colorizer(capture_.path(), config, reporter_);
    return config.colorizer.spec;
  }
  test::TempDir capture_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> out_{std::tmpfile(), &std::fclose};
  Reporter reporter_{ProgressStyle::kPlain, out_.get()};
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

}  // namespace
}  // namespace cnerf
