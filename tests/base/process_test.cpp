#include "src/base/process.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <new>
#include <stdexcept>
#include <vector>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/usage.h"
#include "tests/support/data.h"
#include "tests/support/sanitizers.h"

namespace cnerf {
namespace {

TEST(FindProgram, LooksOnThePathAndTakesPathsAsTheyAre) {
  EXPECT_TRUE(find_program("sh"));
  EXPECT_TRUE(find_program("/bin/sh"));
  EXPECT_FALSE(find_program("no-such-program-anywhere"));
  EXPECT_FALSE(find_program("/bin")) << "a folder";
  EXPECT_FALSE(find_program("/etc/passwd")) << "not executable";
}

TEST(RunProgram, ReturnsTheStatusAndAppendsBothOutputs) {
  const test::TempDir folder;
  EXPECT_EQ(run_program({"/bin/sh", "-c", "echo one; echo two >&2; exit 3"}, folder / "log"), 3);
  EXPECT_EQ(run_program({"/bin/sh", "-c", "echo \"three $1\"", "sh", "a b"}, folder / "log"), 0);
  EXPECT_EQ(read_text_file(folder / "log"), "one\ntwo\nthree a b\n");
  EXPECT_EQ(run_program({"/bin/sh", "-c", "kill -9 $$"}, folder / "log"), 128 + 9);
}

TEST(FailureInChild, IsWhatItThrewOrThatItDidNotEnd) {
  constexpr std::size_t kMemory = std::size_t(64) << 20;
  EXPECT_EQ(failure_in_child([] {}, 10, kMemory), std::nullopt);
  EXPECT_EQ(failure_in_child([] { throw std::runtime_error("refused"); }, 10, kMemory), "refused");
  EXPECT_EQ(failure_in_child([] { throw 1; }, 10, kMemory), "");
  EXPECT_EQ(failure_in_child([] { std::abort(); }, 10, kMemory), "");
  EXPECT_EQ(failure_in_child([] { ::raise(SIGSEGV); }, 10, kMemory), "");
  EXPECT_EQ(failure_in_child([] { ::pause(); }, 0.5, kMemory), "");
  const auto said = failure_in_child([] { throw std::runtime_error(std::string(100'000, 'x')); }, 10, kMemory);
  EXPECT_LE(said.value_or(std::string(9999, 'x')).size(), 4096u);
}

TEST(FailureInChild, IsALackOfMemoryBeyondWhatItMayTake) {
  std::vector<char> taken;
  EXPECT_EQ(failure_in_child([&] { taken.assign(std::size_t(32) << 20, 'x'); }, 10, std::size_t(64) << 20),
            std::nullopt);
  EXPECT_EQ(failure_in_child([&] { taken.assign(std::size_t(128) << 20, 'x'); }, 10, std::size_t(64) << 20), "");
  EXPECT_TRUE(taken.empty());
}

TEST(FailureInChild, ALackOfThisProcesssOwnMemoryIsNotTheFiles) {
  if (test::kIsSanitized) GTEST_SKIP() << "sanitizers end the process, or their memory is not counted as its own";
  const auto under_own_limit = [] {
    (void)limit_growth(std::size_t(32) << 20);
    std::vector<char> taken;
    try {
      (void)failure_in_child([&] { taken.assign(std::size_t(128) << 20, 'x'); }, 10, std::size_t(256) << 20);
    } catch (const std::bad_alloc&) {
      throw std::runtime_error("its own");
    }
  };
  EXPECT_EQ(failure_in_child(under_own_limit, 20, std::size_t(1) << 30), "its own");
}

TEST(RunProgram, WhereAHostLosesHowChildrenEndNoneHasSucceeded) {
  const test::TempDir folder;
  const auto before = std::signal(SIGCHLD, SIG_IGN);
  EXPECT_NE(run_program({"/bin/sh", "-c", "exit 3"}, folder / "log"), 0);
  EXPECT_EQ(failure_in_child([] { std::abort(); }, 10, std::size_t(64) << 20), "");
  std::signal(SIGCHLD, before);
}

TEST(RunProgram, GivesNoInputAndSaysThatThereIsNoScreen) {
  const test::TempDir folder;
  EXPECT_EQ(run_program({"/bin/sh", "-c", "cat; echo $QT_QPA_PLATFORM"}, folder / "log"), 0);
  EXPECT_EQ(read_text_file(folder / "log"), "offscreen\n");
}

TEST(RunProgram, AWatchThatThrowsEndsTheProgramAndItsChildren) {
  const test::TempDir folder;
  const auto start = std::chrono::steady_clock::now();
  int looks = 0;
  const auto watch = [&] {
    if (++looks == 3) throw Interrupted("enough");
  };
  const std::string late = (folder / "late").string();
  EXPECT_THROW(
      (void)run_program({"/bin/sh", "-c", "(sleep 1; touch '" + late + "') & sleep 20"}, folder / "log", watch),
      Interrupted);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
  (void)run_program({"/bin/sh", "-c", "sleep 1.5"}, folder / "log");
  EXPECT_FALSE(std::filesystem::exists(late));
}

TEST(RunProgram, MissingProgramsAndLogsAreNamed) {
  const test::TempDir folder;
  EXPECT_THROW((void)run_program({"/absent/program"}, folder / "log"), DeviceError);
  EXPECT_THROW((void)run_program({"/bin/true"}, folder / "absent" / "log"), OutputError);
}

}  // namespace
}  // namespace cnerf
