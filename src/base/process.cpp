#include "src/base/process.h"

#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <new>
#include <sstream>
#include <thread>

#include "src/base/error.h"
#include "src/base/file_descriptor.h"
#include "src/base/pointers_to.h"
#include "src/base/text.h"
#include "src/base/usage.h"

extern char** environ;  // NOLINT: POSIX

namespace cnerf {
namespace fs = std::filesystem;
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr milliseconds kBetweenLooks{50};
constexpr milliseconds kTimeToEnd{1000};       // of a program whose input was closed
constexpr milliseconds kTimeToDie{200};        // of a program that closed its output: its status is worth a moment
constexpr std::size_t kKeptErrorBytes = 8192;  // of stderr
constexpr std::size_t kMostEarlyBytes = std::size_t(512) << 20;  // of an answer before all was asked
constexpr int kShownErrorLines = 12;
constexpr int kUnknownStatus = W_EXITCODE(127, 0);  // of children whose end a host that ignores SIGCHLD loses

bool is_executable(const fs::path& file) {
  std::error_code failure;
  return fs::is_regular_file(file, failure) && ::access(file.c_str(), X_OK) == 0;
}

/// Our environment with `variables` in place of those of the same names.
std::vector<std::string> environment_with(const std::vector<std::string>& variables) {
  std::vector<std::string> all = variables;
  for (char** ours = environ; *ours != nullptr; ++ours) {
    const std::string_view entry = *ours, name = entry.substr(0, entry.find('=') + 1);
    const auto replaces = [&](const std::string& variable) { return variable.starts_with(name); };
    if (std::ranges::none_of(variables, replaces)) all.emplace_back(entry);
  }
  return all;
}

/// SIGPIPE is held back in this thread while it lives, and swallowed if it came: no handler of the process changes.
class NoBrokenPipeSignal {
 public:
  NoBrokenPipeSignal() {
    sigemptyset(&pipe_);
    sigaddset(&pipe_, SIGPIPE);
    sigset_t pending;
    sigpending(&pending);
    was_pending_ = sigismember(&pending, SIGPIPE) == 1;
    pthread_sigmask(SIG_BLOCK, &pipe_, &before_);
  }
  ~NoBrokenPipeSignal() {
    if (!was_pending_) {
      const timespec now{0, 0};
      while (sigtimedwait(&pipe_, nullptr, &now) == -1 && errno == EINTR) {
      }
    }
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
  NoBrokenPipeSignal(const NoBrokenPipeSignal&) = delete;
  NoBrokenPipeSignal& operator=(const NoBrokenPipeSignal&) = delete;

 private:
  sigset_t pipe_{}, before_{};
  bool was_pending_ = false;
};

}  // namespace

std::optional<fs::path> find_program(const std::string& name) {
  if (name.find('/') != std::string::npos) return is_executable(name) ? std::optional(fs::path(name)) : std::nullopt;
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (const fs::path file = fs::path(folder) / name; is_executable(file)) return file;
  }
  return std::nullopt;
}

std::string shell_word(const std::string& text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

// ---- a started program --------------------------------------------------------------------------------------------

std::optional<std::string> failure_in_child(const std::function<void()>& attempt, double seconds, std::size_t memory) {
  constexpr std::size_t kLongest = 4000;  // a pipe holds it
  constexpr int kFailed = 1, kShortOfOurMemory = 2;
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return std::nullopt;
  const FileDescriptor reads(ends[0]);
  FileDescriptor writes(ends[1]);
  const pid_t child = ::fork();
  if (child < 0) return std::nullopt;
  if (child == 0) {
    // Its end is nobody's business: not that of a debugger's or a fuzzer's handlers either.
    for (const int end : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGALRM}) ::signal(end, SIG_DFL);
    ::close(STDERR_FILENO);
    ::alarm(unsigned(std::ceil(seconds)));
    const bool is_limited_here = limit_growth(memory);
    try {
      attempt();
      ::_exit(0);
    } catch (const std::bad_alloc&) {
      if (!is_limited_here) ::_exit(kShortOfOurMemory);
    } catch (const std::exception& failure) {
      const std::string said = shortened(failure.what(), kLongest);
      (void)!::write(writes.number(), said.data(), said.size());
    } catch (...) {
    }
    ::_exit(kFailed);
  }
  int status = 0;
  // A host that ignores SIGCHLD loses how its children end: nothing speaks for the attempt then.
  if (TEMP_FAILURE_RETRY(::waitpid(child, &status, 0)) != child) return "";
  if (status == 0) return std::nullopt;
  if (WIFEXITED(status) && WEXITSTATUS(status) == kShortOfOurMemory) throw std::bad_alloc();
  writes.reset();
  std::string said(kLongest, ' ');
  const ssize_t size = TEMP_FAILURE_RETRY(::read(reads.number(), said.data(), said.size()));
  said.resize(std::size_t(std::max<ssize_t>(size, 0)));
  return said;
}

Process::Process(std::vector<std::string> words, const Streams& streams, const std::vector<std::string>& variables) {
  std::vector<std::string> environment = environment_with(variables);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, streams.input, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, streams.output, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, streams.errors, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none, defaults;
  sigemptyset(&none);
  sigemptyset(&defaults);
  sigaddset(&defaults, SIGPIPE);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &defaults);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  const int failure = ::posix_spawnp(&pid_, words.front().c_str(), &actions, &attributes, pointers_to(words).data(),
                                     pointers_to(environment).data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (failure != 0) throw DeviceError(words.front() + ": cannot be started: " + std::strerror(failure));
}

bool Process::has_ended(int options) {
  if (ended_) return true;
  pid_t found = 0;
  do {
    found = ::waitpid(pid_, &status_, options);
  } while (found == -1 && errno == EINTR);
  ended_ = found != 0;
  if (found < 0) status_ = kUnknownStatus;
  return ended_;
}

std::optional<int> Process::exit_status(milliseconds patience) {
  const auto last_look = Clock::now() + patience;
  while (!has_ended(WNOHANG)) {
    if (Clock::now() >= last_look) return std::nullopt;
    std::this_thread::sleep_for(milliseconds(2));
  }
  return WIFSIGNALED(status_) ? 128 + WTERMSIG(status_) : WEXITSTATUS(status_);
}

std::string Process::fate() {
  const std::optional<int> status = exit_status(kTimeToDie);
  if (!status) return "is still running";
  if (WIFSIGNALED(status_)) return "was killed by signal " + std::to_string(WTERMSIG(status_));
  // 128 + n is how a shell reports that what it ran was killed by signal n.
  const std::string signal = *status > 128 ? " (signal " + std::to_string(*status - 128) + ")" : "";
  return "exited with " + std::to_string(*status) + signal;
}

void Process::kill_group() {
  ::kill(-pid_, SIGKILL);  // the group may outlive the program that led it
  has_ended(0);
}

int run_program(const std::vector<std::string>& words, const fs::path& log, const std::function<void()>& watch) {
  const auto opened = [](const fs::path& file, int flags) {
    const int descriptor = ::open(file.c_str(), flags | O_CLOEXEC, 0644);
    if (descriptor < 0) throw OutputError(file.string() + ": cannot be opened: " + std::strerror(errno));
    return descriptor;
  };
  const FileDescriptor nothing(opened("/dev/null", O_RDONLY)), output(opened(log, O_WRONLY | O_CREAT | O_APPEND));
  // Some programs link Qt, and need no screen.
  Process process(words, {nothing.number(), output.number(), output.number()}, {"QT_QPA_PLATFORM=offscreen"});
  for (;;) {
    if (const auto status = process.exit_status()) return *status;
    if (watch) watch();
    std::this_thread::sleep_for(kBetweenLooks);
  }
}

// ---- pipes --------------------------------------------------------------------------------------------------------

PipedProcess::PipedProcess(const std::string& command) {
  const auto make_pipe = [](FileDescriptor& read, FileDescriptor& write) {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw DeviceError(std::string("pipe: ") + std::strerror(errno));
    read.reset(ends[0]);
    write.reset(ends[1]);
  };
  FileDescriptor input, output, errors;  // the program's ends
  make_pipe(input, input_);
  make_pipe(output_, output);
  make_pipe(errors_, errors);
  process_.emplace(std::vector<std::string>{"/bin/sh", "-c", command},
                   Process::Streams{input.number(), output.number(), errors.number()});
  for (const FileDescriptor* ours : {&input_, &output_, &errors_}) {
    ::fcntl(ours->number(), F_SETFL, ::fcntl(ours->number(), F_GETFL) | O_NONBLOCK);
  }
}

PipedProcess::~PipedProcess() {
  input_.reset();
  (void)process_->exit_status(kTimeToEnd);
}

void PipedProcess::drain_errors() {
  char buffer[4096];
  while (errors_.number() >= 0) {
    const ssize_t got = ::read(errors_.number(), buffer, sizeof buffer);
    if (got == -1 && errno == EINTR) continue;
    if (got == 0) errors_.reset();
    if (got <= 0) return;
    const std::string text = printable({buffer, std::size_t(got)});
    stderr_tail_ += text;
    if (stderr_tail_.size() > kKeptErrorBytes) stderr_tail_.erase(0, stderr_tail_.size() - kKeptErrorBytes);
    for (ssize_t done = 0; done < got;) {
      const ssize_t put = ::write(STDERR_FILENO, text.data() + done, std::size_t(got - done));
      if (put <= 0) break;  // without a reader the tail is kept all the same
      done += put;
    }
  }
}

/// What is not heard keeps a program from reading on, once the pipe is full.
void PipedProcess::hear_early_answer() {
  std::array<std::byte, 1 << 16> buffer;
  const ssize_t got = ::read(output_.number(), buffer.data(), buffer.size());
  if (got > 0) early_.insert(early_.end(), buffer.begin(), buffer.begin() + got);
  if (got == 0 || early_.size() > kMostEarlyBytes) may_answer_early_ = false;
}

/// Waits until the descriptor is ready; false at the deadline.
bool PipedProcess::wait_for(int descriptor, short events, Deadline deadline) {
  while (true) {
    const auto left = std::chrono::ceil<milliseconds>(deadline - Clock::now()).count();
    if (left <= 0) return false;
    const bool listens = may_answer_early_ && descriptor == input_.number();
    const int answer = listens ? output_.number() : -1;  // poll ignores a negative one
    pollfd waiting[3] = {{descriptor, events, 0}, {errors_.number(), POLLIN, 0}, {answer, POLLIN, 0}};
    const int ready = ::poll(waiting, 3, int(std::min<long long>(left, 1 << 30)));
    if (ready == -1 && errno != EINTR) return false;
    if (waiting[1].revents != 0) drain_errors();
    if (waiting[2].revents != 0) hear_early_answer();
    if (ready > 0 && waiting[0].revents != 0) return true;
  }
}

PipeTrouble PipedProcess::write_all(std::span<const std::byte> bytes, Deadline deadline) {
  const NoBrokenPipeSignal guard;
  while (!bytes.empty()) {
    if (!wait_for(input_.number(), POLLOUT, deadline)) return PipeTrouble::kTimedOut;
    const ssize_t put = ::write(input_.number(), bytes.data(), bytes.size());
    if (put == -1 && (errno == EAGAIN || errno == EINTR)) continue;
    if (put == -1) return PipeTrouble::kEnded;
    bytes = bytes.subspan(std::size_t(put));
  }
  return PipeTrouble::kNone;
}

PipeTrouble PipedProcess::read_all(std::span<std::byte> bytes, Deadline deadline) {
  const std::size_t heard = std::min(early_.size(), bytes.size());
  std::copy_n(early_.begin(), heard, bytes.begin());
  early_.erase(early_.begin(), early_.begin() + std::ptrdiff_t(heard));
  bytes = bytes.subspan(heard);
  while (!bytes.empty()) {
    if (!wait_for(output_.number(), POLLIN, deadline)) return PipeTrouble::kTimedOut;
    const ssize_t got = ::read(output_.number(), bytes.data(), bytes.size());
    if (got == -1 && (errno == EAGAIN || errno == EINTR)) continue;
    if (got <= 0) return PipeTrouble::kEnded;
    bytes = bytes.subspan(std::size_t(got));
  }
  return PipeTrouble::kNone;
}

bool PipedProcess::has_unread_output() const {
  pollfd waiting{output_.number(), POLLIN, 0};
  return !early_.empty() || (::poll(&waiting, 1, 0) > 0 && (waiting.revents & POLLIN) != 0);
}

std::string PipedProcess::last_words() {
  drain_errors();
  const std::size_t end = stderr_tail_.find_last_not_of(" \r\n\t");
  if (end == std::string::npos) return "";
  const std::string text = stderr_tail_.substr(0, end + 1);
  std::size_t start = text.size();
  for (int line = 0; line < kShownErrorLines && start != std::string::npos && start > 0; ++line) {
    start = text.rfind('\n', start - 1);
  }
  return "\nIts last lines on stderr:\n" + (start == std::string::npos ? text : text.substr(start + 1));
}

}  // namespace cnerf
