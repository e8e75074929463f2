/// A small, fixed part of the campaigns of cnerf-fault-campaign.

#include <gtest/gtest.h>

#include "tests/faults/campaigns.h"
#include "tests/support/data.h"

namespace cnerf::faults {
namespace {

class Faults : public testing::Test {
 protected:
  static void SetUpTestSuite() { shared_ = std::make_unique<test::TempDir>(); }
  static void TearDownTestSuite() { shared_.reset(); }
  static CampaignOptions options(const std::vector<std::string>& commands) {
    CampaignOptions options;
    options.subject = {CNERF_PROGRAM, CNERF_FAULT_SHIM};
    options.scratch = shared_->path();
    options.commands = commands;
    options.is_quiet = true;
    return options;
  }
  inline static std::unique_ptr<test::TempDir> shared_;
};

TEST_F(Faults, OperationsOfABakeAndAColorization) {
  CampaignOptions some = options({"bake", "colorize"});
  some.every = 360;
  const Report report = disturb_operations(some);
  EXPECT_TRUE(report.violations.empty()) << report.text();
}

TEST_F(Faults, KillsAtRandomMoments) {
  CampaignOptions some = options({"train", "bake"});
  some.count = 2;
  const Report report = kill_at_random(some);
  EXPECT_TRUE(report.violations.empty()) << report.text();
}

TEST_F(Faults, TwoProgramsInOneFolder) {
  CampaignOptions some = options({"bake", "bake-smaller", "colorize", "info", "view"});
  some.count = 2;
  const Report report = run_pairs(some);
  EXPECT_TRUE(report.violations.empty()) << report.text();
}

TEST_F(Faults, LargeAllocationsOfASample) {
  CampaignOptions some = options({"sample"});
  some.every = 5;
  const Report report = starve(some);
  EXPECT_EQ(report.rows.size(), 1U);
  EXPECT_TRUE(report.violations.empty()) << report.text();
}

TEST_F(Faults, LargeAllocationsOfABakeAndATraining) {
  CampaignOptions some = options({"bake", "train"});
  some.every = 300;
  const Report report = starve(some);
  EXPECT_EQ(report.rows.size(), 2U) << "trials of both";
  EXPECT_TRUE(report.violations.empty()) << report.text();
}

/// The judge sees what is wrong.
TEST_F(Faults, AreSeen) {
  const Content whole = {{"a", "1"}, {"b", "2"}};
  EXPECT_EQ(difference(whole, whole), "");
  EXPECT_EQ(difference({{"a", "1"}}, whole), " missing b");
  EXPECT_EQ(difference({{"a", "1"}, {"b", "3"}, {"c", ""}}, whole), " other b additional c");
  EXPECT_EQ(leftovers({{"d/.x.partial-7.json", ""}, {"d/x.json", ""}, {"unfinished.bake", ""}}),
            " d/.x.partial-7.json unfinished.bake");
}

}  // namespace
}  // namespace cnerf::faults
