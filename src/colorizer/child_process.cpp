#include "src/colorizer/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <thread>

#include "src/base/error.h"

extern char** environ;  // NOLINT: POSIX

namespace cnerf {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr std::size_t kKeptErrorBytes = 8192;
constexpr int kShownErrorLines = 12;
constexpr milliseconds kTimeToEnd{1000};

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

/// Both ends closed on exec, so that no other child inherits them and keeps a pipe open.
struct Pipe {
  int read = -1, write = -1;
  Pipe() {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) throw ColorizerError(std::string("pipe: ") + std::strerror(errno));
    read = ends[0];
    write = ends[1];
  }
};

void close_fd(int& fd) {
  if (fd >= 0) ::close(fd);
  fd = -1;
}

void set_non_blocking(int fd) {
  fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
}

pid_t spawn_shell(const std::string& command, int input, int output, int errors, int* error) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
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
  std::string text = command;
  char shell[] = "/bin/sh", option[] = "-c";
  char* arguments[] = {shell, option, text.data(), nullptr};
  pid_t pid = -1;
  *error = posix_spawn(&pid, shell, &actions, &attributes, arguments, environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return pid;
}

}  // namespace

ChildProcess::ChildProcess(const std::string& command) {
  Pipe input, output, errors;
  int error = 0;
  pid_ = spawn_shell(command, input.read, output.write, errors.write, &error);
  close_fd(input.read);
  close_fd(output.write);
  close_fd(errors.write);
  input_ = input.write;
  output_ = output.read;
  errors_ = errors.read;
  if (error != 0) {
    close_fd(input_);
    close_fd(output_);
    close_fd(errors_);
    throw ColorizerError("exec:" + command + ": could not be started: " + std::strerror(error));
  }
  for (int fd : {input_, output_, errors_}) set_non_blocking(fd);
}

ChildProcess::~ChildProcess() {
  close_fd(input_);
  const auto patience = Clock::now() + kTimeToEnd;
  while (!reap(false) && Clock::now() < patience) std::this_thread::sleep_for(milliseconds(5));
  kill_group();
  close_fd(output_);
  close_fd(errors_);
}

bool ChildProcess::reap(bool wait) {
  if (reaped_) return true;
  pid_t ended = 0;
  do {
    ended = waitpid(pid_, &status_, wait ? 0 : WNOHANG);
  } while (ended == -1 && errno == EINTR);
  reaped_ = ended == pid_ || ended == -1;
  return reaped_;
}

void ChildProcess::kill_group() {
  ::kill(-pid_, SIGKILL);  // the group may outlive the shell that led it
  reap(true);
}

void ChildProcess::drain_errors() {
  char buffer[4096];
  while (errors_ >= 0) {
    const ssize_t got = ::read(errors_, buffer, sizeof buffer);
    if (got == -1 && errno == EINTR) continue;
    if (got == 0) close_fd(errors_);
    if (got <= 0) return;
    stderr_tail_.append(buffer, std::size_t(got));
    if (stderr_tail_.size() > kKeptErrorBytes) stderr_tail_.erase(0, stderr_tail_.size() - kKeptErrorBytes);
    for (ssize_t done = 0; done < got;) {
      const ssize_t put = ::write(STDERR_FILENO, buffer + done, std::size_t(got - done));
      if (put <= 0) break;  // nobody listens: the tail is kept all the same
      done += put;
    }
  }
}

/// Waits until `fd` is ready; false at the deadline.
bool ChildProcess::wait_for(int fd, short events, Deadline deadline) {
  while (true) {
    const auto left = std::chrono::ceil<milliseconds>(deadline - Clock::now()).count();
    if (left <= 0) return false;
    pollfd waiting[2] = {{fd, events, 0}, {errors_, POLLIN, 0}};  // poll ignores a negative descriptor
    const int ready = ::poll(waiting, 2, int(std::min<long long>(left, 1 << 30)));
    if (ready == -1 && errno != EINTR) return false;
    if (waiting[1].revents != 0) drain_errors();
    if (ready > 0 && waiting[0].revents != 0) return true;
  }
}

ChildTrouble ChildProcess::write_all(std::span<const std::byte> bytes, Deadline deadline) {
  const NoBrokenPipeSignal guard;
  while (!bytes.empty()) {
    if (!wait_for(input_, POLLOUT, deadline)) return ChildTrouble::kTimedOut;
    const ssize_t put = ::write(input_, bytes.data(), bytes.size());
    if (put == -1 && (errno == EAGAIN || errno == EINTR)) continue;
    if (put == -1) return ChildTrouble::kEnded;
    bytes = bytes.subspan(std::size_t(put));
  }
  return ChildTrouble::kNone;
}

ChildTrouble ChildProcess::read_all(std::span<std::byte> bytes, Deadline deadline) {
  while (!bytes.empty()) {
    if (!wait_for(output_, POLLIN, deadline)) return ChildTrouble::kTimedOut;
    const ssize_t got = ::read(output_, bytes.data(), bytes.size());
    if (got == -1 && (errno == EAGAIN || errno == EINTR)) continue;
    if (got <= 0) return ChildTrouble::kEnded;
    bytes = bytes.subspan(std::size_t(got));
  }
  return ChildTrouble::kNone;
}

std::string ChildProcess::last_words() {
  drain_errors();
  std::size_t from = stderr_tail_.find_last_not_of(" \r\n\t");
  if (from == std::string::npos) return "";
  std::string text = stderr_tail_.substr(0, from + 1);
  std::size_t start = text.size();
  for (int line = 0; line < kShownErrorLines && start != std::string::npos && start > 0; ++line) {
    start = text.rfind('\n', start - 1);
  }
  if (start != std::string::npos && start > 0) text.erase(0, start + 1);
  return "\nIts last lines on stderr:\n" + text;
}

std::string ChildProcess::fate() {
  // A program that closed its output is about to end: its status is worth a moment.
  const auto patience = Clock::now() + milliseconds(200);
  while (!reap(false) && Clock::now() < patience) std::this_thread::sleep_for(milliseconds(2));
  if (!reaped_) return "is still running";
  if (WIFSIGNALED(status_)) return "was killed by signal " + std::to_string(WTERMSIG(status_));
  const int code = WEXITSTATUS(status_);
  // 128 + n is how a shell reports that what it ran was killed by signal n.
  return "exited with " + std::to_string(code) + (code > 128 ? " (signal " + std::to_string(code - 128) + ")" : "");
}

}  // namespace cnerf
