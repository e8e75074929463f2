#include "tests/e2e/program.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <thread>

#include "src/base/files.h"
#include "src/base/pointers_to.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t kNoLimit = 0;

/// Starts the program with its output in files.
pid_t start(const std::vector<std::string>& arguments, const fs::path& out, const fs::path& err,
            std::size_t file_limit) {
  std::vector<std::string> words = {CNERF_PROGRAM};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv = pointers_to(words);
  const pid_t child = ::fork();
  if (child != 0) return child;
  ::dup2(::open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), STDOUT_FILENO);
  ::dup2(::open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), STDERR_FILENO);
  if (file_limit != kNoLimit) {
    ::signal(SIGXFSZ, SIG_IGN);  // writing then fails instead
    const rlimit limit{file_limit, file_limit};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ::setenv("CUDA_VISIBLE_DEVICES", "", 1);  // tests do the same on every machine: resuming is bit for bit on processors
  ::execv(argv[0], argv.data());
  ::_exit(127);
}

int exit_code_of(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
}

/// Waits for the end of the program; sends SIGINT when its output holds `signal_at`, if that is given.
int wait_for(pid_t child, const fs::path& out, const std::string& signal_at) {
  bool signalled = signal_at.empty();
  for (;;) {
    int status = 0;
    if (::waitpid(child, &status, signalled ? 0 : WNOHANG) == child) return exit_code_of(status);
    if (read_text_file(out).find(signal_at) != std::string::npos) {
      ::kill(child, SIGINT);
      signalled = true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

ProgramResult run(const std::vector<std::string>& arguments, const std::string& signal_at,
                  std::size_t file_limit = kNoLimit) {
  const TempDir folder;
  const fs::path out = folder / "out", err = folder / "err";
  write_file(out, std::string_view());
  const pid_t child = start(arguments, out, err, file_limit);
  const int code = wait_for(child, out, signal_at);
  return {code, read_text_file(out), read_text_file(err)};
}

/// Makes `name` below the folder of fixtures, unless it is there.
fs::path fixture(const std::string& name, const std::function<ProgramResult(const fs::path& folder)>& make) {
  static const TempDir own;
  const char* shared = std::getenv("CNERF_E2E");
  const fs::path folder = shared != nullptr ? fs::path(shared) / name : own / name;
  if (fs::exists(folder)) return folder;
  const ProgramResult made = make(folder);
  EXPECT_EQ(made.exit_code, 0) << name << ": " << made.err;
  return folder;
}

}  // namespace

std::string program() {
  return CNERF_PROGRAM;
}

ProgramResult cnerf(const std::vector<std::string>& arguments) {
  return run(arguments, "");
}

ProgramResult cnerf_interrupted_at(const std::vector<std::string>& arguments, const std::string& text) {
  return run(arguments, text);
}

ProgramResult cnerf_with_file_limit(const std::vector<std::string>& arguments, std::size_t bytes) {
  return run(arguments, "", bytes);
}

fs::path copied(const fs::path& from, const fs::path& to) {
  fs::copy(from, to, fs::copy_options::recursive);
  return to;
}

const fs::path& tiny_capture() {
  static const fs::path capture = fixture("capture", [](const fs::path& folder) {
    return cnerf({"sample", "-o", folder.string(), "--views", "9", "--width", "48", "--height", "36",
                  "--samples-per-pixel", "1"});
  });
  return capture;
}

const fs::path& tiny_run() {
  static const fs::path run = fixture("run", [](const fs::path& folder) {
    return cnerf(concatenated({"train", tiny_capture().string(), "-o", folder.string()}, tiny_options()));
  });
  return run;
}

const fs::path& tiny_take() {
  static const fs::path take = fixture("take", [](const fs::path& folder) {
    return cnerf({"colorize", copied(tiny_run(), folder).string(), "--take", "grey", "--colorizer", "grey"});
  });
  return take;
}

const fs::path& tiny_bake() {
  static const fs::path bake = fixture("bake", [](const fs::path& folder) {
    return cnerf({"bake", tiny_run().string(), "-o", folder.string()});
  });
  return bake;
}

std::vector<std::string> files_below(const fs::path& folder) {
  std::vector<std::string> files;
  if (!fs::exists(folder)) return files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files.push_back(fs::relative(entry.path(), folder).generic_string());
  }
  std::ranges::sort(files);
  return files;
}

std::vector<std::string> concatenated(std::vector<std::string> a, const std::vector<std::string>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

}  // namespace cnerf::test
