#include "src/compare/methods.h"

#include <gtest/gtest.h>

#include "src/base/error.h"

namespace cnerf::compare {
namespace {

TEST(Methods, ListsAreReadAndUnknownOnesRefused) {
  EXPECT_EQ(parse_methods("all").size(), std::size(kMethods));
  const auto two = parse_methods("grey,colornerf,grey");
  ASSERT_EQ(two.size(), 2u);
  EXPECT_STREQ(two[0]->name, "grey");
  EXPECT_THROW((void)parse_methods("colornef"), UsageError);
  EXPECT_THROW((void)parse_methods(""), UsageError);
}

TEST(Methods, AblationsChangeWhatTheyAreNamedAfter) {
  const auto of = [](const char* name) { return stage2_of(*parse_methods(name).front(), Stage2Options{}); };
  const Stage2Options full = of("colornerf");
  EXPECT_TRUE(full.purify.enabled);
  EXPECT_FALSE(of("without-purification").purify.enabled);
  const auto method = [](const char* name) -> const Method& { return *parse_methods(name).front(); };
  EXPECT_FALSE(method("colornerf").is_photometric);
  EXPECT_FALSE(method("without-purification").is_photometric);
  EXPECT_TRUE(method("without-classification").is_photometric);
  EXPECT_TRUE(of("without-classification").purify.enabled);
  EXPECT_EQ(method("without-classification").view_sizes, 0);
  EXPECT_EQ(method("colorize-then-fuse").view_sizes, 1);
  EXPECT_TRUE(method("colorize-then-fuse").is_photometric);
  EXPECT_EQ(method("multi-scale-teacher").view_sizes, 3);
  EXPECT_TRUE(method("key-view-distilled").distills_key_view);
  EXPECT_FALSE(of("key-view-distilled").purify.enabled) << "its colorizer does not contradict itself";
  EXPECT_EQ(of("colornerf-paper").decode_temperature, 0);
  EXPECT_EQ(of("colornerf-paper").purify.opinions, 1);
  Stage2Options smooth;
  smooth.spread_weight = 2;
  smooth.regression_weight = 3;
  EXPECT_EQ(stage2_of(*parse_methods("colornerf-paper").front(), smooth).spread_weight, 0) << "not in the paper";
  EXPECT_EQ(stage2_of(*parse_methods("colornerf-paper").front(), smooth).regression_weight, 0);
  EXPECT_EQ(of("colornerf-paper").sure_colors, 0);
  EXPECT_EQ(stage2_of(*parse_methods("without-purification").front(), smooth).spread_weight, 2);
  EXPECT_EQ(of("oracle").patches, full.patches);
  EXPECT_EQ(of("positional-encoding").patches, full.patches);
  Stage2Options fast;
  fast.learning_rate = 0.05;
  const auto rate_of = [&](const char* name) { return stage2_of(*parse_methods(name).front(), fast).learning_rate; };
  EXPECT_EQ(rate_of("without-purification"), 0.05);
  EXPECT_EQ(rate_of("without-classification"), Stage2Options{}.learning_rate) << "its own best step size";
  EXPECT_EQ(of("positional-encoding").learning_rate, kPositionalLearningRate);
  EXPECT_FALSE(method("positional-encoding").is_photometric);
}

}  // namespace
}  // namespace cnerf::compare
