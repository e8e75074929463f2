#include "tests/mutants/limited_run.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <thread>

#include "src/base/error.h"
#include "src/base/pointers_to.h"

extern char** environ;

namespace cnerf::mutants {
namespace {
namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr auto kBetweenLooks = std::chrono::milliseconds(2);
constexpr std::size_t kMostOutput = std::size_t(1) << 20, kLargestFile = std::size_t(1) << 30;

std::string begin_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string text(kMostOutput, '\0');
  in.read(text.data(), std::streamsize(text.size()));
  text.resize(std::size_t(in.gcount()));
  return text;
}

/// Ours, with what makes runs cheap and alike.
std::vector<std::string> environment(const Limits& limits) {
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) variables.emplace_back(*variable);
  variables.insert(variables.end(), {"CUDA_VISIBLE_DEVICES=", "OMP_NUM_THREADS=1", "MKL_NUM_THREADS=1"});
  if (limits.sanitized) {
    std::erase_if(variables, [](const std::string& each) { return each.starts_with("ASAN_OPTIONS="); });
    variables.emplace_back("ASAN_OPTIONS=hard_rss_limit_mb=8192:detect_leaks=0");
  }
  return variables;
}

void limit(int resource, std::size_t most) {
  const rlimit both{most, most};
  ::setrlimit(decltype(RLIMIT_AS)(resource), &both);
}

/// How long its first thread was ready and had no processor: on a busy machine that is no fault of the program.
Clock::duration starved(pid_t process) {
  std::ifstream state("/proc/" + std::to_string(process) + "/schedstat");
  long long ran = 0, waited = 0;  // nanoseconds
  state >> ran >> waited;
  return std::chrono::duration_cast<Clock::duration>(std::chrono::nanoseconds(waited));
}

/// Only what may be done between fork and exec of a program with threads.
[[noreturn]] void become(char** words, char** variables, const fs::path& out, const fs::path& err,
                         const Limits& limits) {
  ::setpgid(0, 0);
  ::dup2(::open("/dev/null", O_RDONLY), STDIN_FILENO);
  ::dup2(::open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), STDOUT_FILENO);
  ::dup2(::open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), STDERR_FILENO);
  ::signal(SIGXFSZ, SIG_IGN);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_FSIZE, kLargestFile);
  if (limits.address_bytes > 0) limit(RLIMIT_AS, limits.address_bytes);
  ::execve(words[0], words, variables);
  ::_exit(127);
}

}  // namespace

Outcome run_limited(const std::vector<std::string>& words, const fs::path& scratch, const Limits& limits,
                    const std::string& interrupt_at) {
  fs::create_directories(scratch);
  const fs::path out = scratch / "out.txt", err = scratch / "err.txt";
  fs::remove(out);
  std::vector<std::string> argument_texts = words, variable_texts = environment(limits);
  std::vector<char*> arguments = pointers_to(argument_texts), variables = pointers_to(variable_texts);
  const auto begin = Clock::now();
  const pid_t child = ::fork();
  if (child < 0) throw DeviceError("no process can be started");
  if (child == 0) become(arguments.data(), variables.data(), out, err, limits);
  ::setpgid(child, child);

  Outcome outcome;
  bool is_interrupted = interrupt_at.empty();
  int status = 0;
  rusage usage{};
  while (::wait4(child, &status, WNOHANG, &usage) != child) {
    if (!is_interrupted && begin_of(out).find(interrupt_at) != std::string::npos) {
      ::kill(child, SIGINT);
      is_interrupted = true;
    }
    if (!outcome.timed_out && Clock::now() - begin > limits.wall &&
        Clock::now() - begin > limits.wall + starved(child)) {
      outcome.timed_out = true;
      ::kill(-child, SIGKILL);
    }
    std::this_thread::sleep_for(kBetweenLooks);
  }
  ::kill(-child, SIGKILL);  // whatever it left behind
  outcome.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  outcome.peak_bytes = std::size_t(usage.ru_maxrss) << 10;
  if (WIFEXITED(status)) outcome.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) outcome.signal = WTERMSIG(status);
  outcome.out = begin_of(out);
  outcome.err = begin_of(err);
  return outcome;
}

}  // namespace cnerf::mutants
