/// Two processes of the program, which find each other on loopback: what they make, and what happens when one of them
/// dies or stops.

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <map>
#include <thread>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/pointers_to.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr double kLongestEnd = 30;  // seconds from a loss to the end of all other ranks

/// One that is free now.
int free_port() {
  const int number = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ::socklen_t size = sizeof address;
  EXPECT_EQ(::bind(number, reinterpret_cast<sockaddr*>(&address), size), 0);
  EXPECT_EQ(::getsockname(number, reinterpret_cast<sockaddr*>(&address), &size), 0);
  ::close(number);
  return ntohs(address.sin_port);
}

using Variables = std::map<std::string, std::string>;

/// Ranks of the program on this machine; those that are left are killed at the end.
class Launched {
 public:
  /// @param more  variables beside those of every launch
  Launched(int size, const std::vector<std::string>& arguments, const Variables& more = {}) {
    Variables variables = {{"WORLD_SIZE", std::to_string(size)},
                           {"LOCAL_WORLD_SIZE", std::to_string(size)},
                           {"MASTER_ADDR", "127.0.0.1"},
                           {"MASTER_PORT", std::to_string(free_port())},
                           {"OMP_NUM_THREADS", "1"},  // a colorizer's answers depend on it
                           {"CUDA_VISIBLE_DEVICES", ""}};
    for (const auto& [name, value] : more) variables[name] = value;
    for (int rank = 0; rank < size; ++rank) {
      write_file(output(rank), std::string_view());
      variables["RANK"] = variables["LOCAL_RANK"] = std::to_string(rank);
      children_.push_back(start(rank, arguments, variables));
    }
  }
  ~Launched() {
    for (const pid_t child : children_) {
      if (child > 0) ::kill(child, SIGKILL), ::waitpid(child, nullptr, 0);
    }
  }
  Launched(const Launched&) = delete;
  Launched& operator=(const Launched&) = delete;

  [[nodiscard]] pid_t process(int rank) const { return children_.at(std::size_t(rank)); }
  /// Waits for its end.  @return  as a shell has it
  int exit_code(int rank) {
    int status = 0;
    EXPECT_EQ(::waitpid(process(rank), &status, 0), process(rank));
    children_[std::size_t(rank)] = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  [[nodiscard]] std::string said(int rank) const { return read_text_file(output(rank)); }
  /// Waits until a file is there.
  void wait_for(const fs::path& file) {
    while (!fs::exists(file)) {
      ASSERT_EQ(::waitpid(process(0), nullptr, WNOHANG), 0) << said(0);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }

 private:
  [[nodiscard]] fs::path output(int rank) const { return folder_ / ("rank" + std::to_string(rank)); }

  [[nodiscard]] pid_t start(int rank, const std::vector<std::string>& arguments, const Variables& variables) const {
    std::vector<std::string> words = {program()};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv = pointers_to(words);
    const pid_t child = ::fork();
    if (child != 0) return child;
    const int out = ::open(output(rank).c_str(), O_WRONLY | O_APPEND, 0600);
    ::dup2(out, STDOUT_FILENO);
    ::dup2(out, STDERR_FILENO);
    for (const auto& [name, value] : variables) ::setenv(name.c_str(), value.c_str(), 1);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }

  TempDir folder_;
  std::vector<pid_t> children_;
};

void expect_success(Launched& ranks, int size) {
  for (int rank = 0; rank < size; ++rank) EXPECT_EQ(ranks.exit_code(rank), 0) << ranks.said(rank);
}

std::vector<std::string> run_to(const fs::path& out) {
  return concatenated({"run", tiny_capture().string(), "-o", out.string(), "--colorizer", "builtin"}, tiny_options());
}

/// What holds neither times nor paths.
const std::vector<std::string> kPayload = {
    "stage1.snapshot",          "takes/builtin/take.snapshot", "metrics.json", "contact_sheet.png",
    "bakes/builtin/volume.vdb", "takes/builtin/bases.png",     "config.toml",  "renders/builtin/turntable.mp4"};

/// A VDB file has a number of its own in its first bytes.
std::string payload_hash(const fs::path& file) {
  constexpr std::size_t kVdbHeader = 57;
  const std::vector<std::byte> content = read_binary_file(file);
  return sha256(std::span(content).subspan(file.extension() == ".vdb" ? kVdbHeader : 0));
}

TEST(Processes, ARunOfTwoIsARunAndRepeatsBitForBit) {
  const TempDir folder;
  const fs::path alone = folder / "alone";
  const ProgramResult one = cnerf(run_to(alone));
  ASSERT_EQ(one.exit_code, 0) << one.err;
  for (const char* name : {"a", "b"}) {
    Launched ranks(2, run_to(folder / name));
    expect_success(ranks, 2);
    EXPECT_EQ(ranks.said(1), "") << "rank 0 speaks for all";
    EXPECT_EQ(files_below(folder / name), files_below(alone));
  }
  for (const std::string& file : kPayload) {
    EXPECT_EQ(payload_hash(folder / "a" / file), payload_hash(folder / "b" / file)) << file;
  }
}

TEST(Processes, PicturesDoNotDependOnWhoRendersThem) {
  const TempDir folder;
  const auto render = [&](const std::string& name) {
    return std::vector<std::string>{"render", tiny_take().string(),     "--format", "png,exr",
                                    "-o",     (folder / name).string(), "--take",   "grey"};
  };
  ASSERT_EQ(cnerf(render("alone")).exit_code, 0);
  Launched ranks(3, render("shared"));
  expect_success(ranks, 3);
  EXPECT_EQ(files_below(folder / "shared"), files_below(folder / "alone"));
  for (const std::string& file : files_below(folder / "alone")) {
    EXPECT_EQ(sha256_of_file(folder / "shared" / file), sha256_of_file(folder / "alone" / file)) << file;
  }
}

TEST(Processes, MetricsDoNotDependOnWhoMeasures) {
  const TempDir folder;
  const fs::path alone = copied(tiny_take(), folder / "alone"), shared = copied(tiny_take(), folder / "shared");
  ASSERT_EQ(cnerf({"eval", alone.string()}).exit_code, 0);
  Launched ranks(2, {"eval", shared.string()});
  expect_success(ranks, 2);
  for (const char* file : {"metrics.json", "contact_sheet.png"}) {
    EXPECT_EQ(sha256_of_file(shared / file), sha256_of_file(alone / file)) << file;
  }
}

/// Steps that never end, with a checkpoint every twenty.
std::vector<std::string> endless(const fs::path& out) {
  return concatenated({"train", tiny_capture().string(), "-o", out.string()}, tiny_options({"stage1.steps=1000000"}));
}

/// Loses a rank by a signal in the middle of a training; `survivor` has to say so. Then the same command goes on.
void lose(int victim, int signal, const std::string& complaint) {
  const TempDir folder;
  const fs::path out = folder / "run", snapshot = out / "stage1.snapshot";
  const int survivor = 1 - victim;
  {
    Launched ranks(2, endless(out));
    ranks.wait_for(snapshot);
    const std::string pid = std::to_string(ranks.process(victim));
    const auto start = std::chrono::steady_clock::now();
    ASSERT_EQ(::kill(ranks.process(victim), signal), 0);
    ::kill(ranks.process(survivor), SIGPIPE);  // as where it writes to the other at that moment
    EXPECT_EQ(ranks.exit_code(survivor), int(ExitCode::kRanks)) << ranks.said(survivor);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    EXPECT_LT(took.count(), kLongestEnd);
    EXPECT_THAT(ranks.said(survivor), HasSubstr("rank " + std::to_string(victim) + " (pid " + pid + " on "));
    EXPECT_THAT(ranks.said(survivor), HasSubstr(complaint));
  }
  for (const std::string& file : files_below(out)) {
    EXPECT_FALSE(victim == 1 && is_temporary(file)) << file << " is half written";
  }
  Launched ranks(2, concatenated(endless(out), {"--resume", "--set", "stage1.max_seconds=0.5"}));
  expect_success(ranks, 2);
}

/// Both at once, since each takes as long as the survivors are patient.
TEST(Processes, OneThatDiesAndOneThatStopsAreNamed) {
  const std::jthread stops([] { lose(1, SIGSTOP, "has shown no sign of life"); });
  lose(1, SIGKILL, "has shown no sign of life");
}

TEST(Processes, RankZeroThatDiesIsNamed) {
  lose(0, SIGKILL, "is gone");
}

/// torchrun's agent keeps a store itself; another job's rank 0 stands in for it, and its words are told apart.
TEST(Processes, TheStoreMayBeSomebodyElses) {
  const TempDir folder;
  const std::string port = std::to_string(free_port());
  Launched agent(2, endless(folder / "agent"), {{"MASTER_PORT", port}, {"TORCHELASTIC_RUN_ID", "agent"}});
  agent.wait_for(folder / "agent/stage1.snapshot");
  const auto words = concatenated({"train", tiny_capture().string(), "-o", (folder / "job").string()}, tiny_options());
  Launched job(2, words,
               {{"MASTER_PORT", port}, {"TORCHELASTIC_RUN_ID", "job"}, {"TORCHELASTIC_USE_AGENT_STORE", "True"}});
  expect_success(job, 2);
  EXPECT_TRUE(fs::exists(folder / "job/stage1.snapshot"));
}

#if CNERF_COMPARE
TEST(Processes, CellsOfAComparisonAreDealtOut) {
  const TempDir folder;
  const auto compare = [&](const std::string& out) {
    return concatenated(
        {"compare", tiny_capture().string(), "-o", (folder / out).string(), "--methods", "grey,oracle", "--seeds", "3"},
        tiny_options());
  };
  ASSERT_EQ(cnerf(compare("alone")).exit_code, 0);
  Launched ranks(2, compare("shared"));
  expect_success(ranks, 2);
  EXPECT_EQ(files_below(folder / "shared"), files_below(folder / "alone"));
}
#endif

TEST(Processes, CtrlCSavesAndGoesOn) {
  const TempDir folder;
  const fs::path out = folder / "run";
  Launched ranks(2, endless(out));
  ranks.wait_for(out / "stage1.snapshot");
  ASSERT_EQ(::kill(ranks.process(1), SIGINT), 0);  // as Slurm may tell one of them
  for (int rank = 0; rank < 2; ++rank)
    EXPECT_EQ(ranks.exit_code(rank), int(ExitCode::kInterrupted)) << ranks.said(rank);
  EXPECT_THAT(ranks.said(0), HasSubstr("saved"));
}

TEST(Processes, AnErrorOfRankZeroIsHeardByAll) {
  const TempDir folder;
  write_file(folder / "run/other.txt", std::string_view("no run"));
  Launched ranks(2, endless(folder / "run"));
  EXPECT_EQ(ranks.exit_code(0), int(ExitCode::kUsage)) << ranks.said(0);
  const int code = ranks.exit_code(1);
  EXPECT_TRUE(code == int(ExitCode::kUsage) || code == int(ExitCode::kRanks)) << ranks.said(1);
}

}  // namespace
}  // namespace cnerf::test
