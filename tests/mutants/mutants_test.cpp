/// A small part of the campaigns, always the same, and the campaigns' own parts: a check that finds nothing must be
/// able to find something.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "src/base/files.h"
#include "tests/mutants/campaign.h"
#include "tests/mutants/mutate.h"
#include "tests/mutants/server_campaign.h"
#include "tests/support/data.h"

namespace cnerf::mutants {
namespace {
namespace fs = std::filesystem;
using testing::IsEmpty;

TEST(Mutants, AreOfTheirSeed) {
  const std::string original = "{\"a\": 12, \"b\": [\"word\", -3.5e2],\n \"c\": null}";
  for (std::size_t number = 0; number < 50; ++number) {
    Random one(7, "kind", number), same(7, "kind", number);
    EXPECT_EQ(mutate_text(original, one).bytes, mutate_text(original, same).bytes);
  }
  Random a(7, "kind", 1), b(8, "kind", 1), c(7, "other", 1);
  const std::size_t first = a.below(1 << 30);
  EXPECT_NE(first, b.below(1 << 30));
  EXPECT_NE(first, c.below(1 << 30));
}

TEST(Mutants, DifferFromTheOriginal) {
  const std::string original = "w = 24\nh = 16\nname = \"view\"\n";
  Random random(3);
  int same = 0;
  for (int i = 0; i < 400; ++i) same += mutate_text(original, random).bytes == original ? 1 : 0;
  EXPECT_LT(same, 40) << "a value may be replaced by itself";
  EXPECT_FALSE(mutate_bytes("", random).bytes.empty());
  EXPECT_FALSE(mutate_text("", random).change.empty());
}

TEST(Mutants, EndsAreJudged) {
  CampaignOptions options;
  options.limits.sanitized = false;
  const auto verdict = [&](int code, int signal, const std::string& err, std::size_t peak = 0, bool timed_out = false) {
    return verdict_of({code, signal, timed_out, peak, 0, "", err}, "poses.json", options);
  };
  EXPECT_EQ(verdict(0, 0, ""), Verdict::kAccepted);
  EXPECT_EQ(verdict(65, 0, "capture/poses.json: frames: expected a list"), Verdict::kRefused);
  EXPECT_EQ(verdict(65, 0, "expected a list"), Verdict::kUnnamed);
  EXPECT_EQ(verdict(70, 0, "poses.json"), Verdict::kInternal);
  EXPECT_EQ(verdict(1, 0, "poses.json"), Verdict::kInternal);
  EXPECT_EQ(verdict(-1, 11, ""), Verdict::kCrash);
  EXPECT_EQ(verdict(65, 0, "poses.json\nERROR: AddressSanitizer: heap-use-after-free"), Verdict::kCrash);
  EXPECT_EQ(verdict(-1, 9, "", 0, true), Verdict::kHang);
  EXPECT_EQ(verdict(65, 0, "poses.json", std::size_t(2) << 30), Verdict::kMemory);
  options.limits.sanitized = true;
  EXPECT_EQ(verdict(65, 0, "poses.json", std::size_t(2) << 30), Verdict::kRefused);
}

TEST(Mutants, LimitsEndAProgram) {
  const test::TempDir folder;
  const Outcome sleeping = run_limited({"/bin/sleep", "20"}, folder.path(), {std::chrono::seconds(1)});
  EXPECT_TRUE(sleeping.timed_out);
  const Outcome killed = run_limited({"/bin/sh", "-c", "kill -SEGV $$"}, folder.path(), {});
  EXPECT_EQ(killed.signal, 11);
  const Outcome spoken = run_limited({"/bin/sh", "-c", "echo out; echo err >&2; exit 65"}, folder.path(), {});
  EXPECT_EQ(spoken.exit_code, 65);
  EXPECT_EQ(spoken.out + spoken.err, "out\nerr\n");
  EXPECT_GT(spoken.peak_bytes, 0U);
}

TEST(Mutants, ASliceOfTheCampaignFindsNothing) {
  const test::TempDir folder;
  CampaignOptions options;
  options.program = CNERF_PROGRAM;
  options.folder = folder.path();
  options.per_kind = 1;
  std::string said;
  options.say = [&](const std::string& line) { said += line + "\n"; };
  const std::vector<Row> rows = run_campaign(options);
  EXPECT_GT(rows.size(), 25U);
  for (const Row& row : rows) EXPECT_EQ(row.violations(), 0U) << row.kind << "\n" << said;
}

TEST(ServerCampaign, ASliceFindsNothing) {
  const test::TempDir folder;
  ServerOptions options;
  options.program = CNERF_PROGRAM;
  options.folder = folder.path();
  options.slow = options.silent = 30;
  options.streams = 20;
  options.aborts = 30;
  options.garbage = 200;
  options.seconds = 2;
  options.patience = 5;  // beside other tests
  const std::vector<ServerRow> rows = run_server_campaign(options);
  for (const ServerRow& row : rows) EXPECT_THAT(row.violations, IsEmpty()) << table_of(rows);
}

}  // namespace
}  // namespace cnerf::mutants
