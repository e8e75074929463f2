#pragma once
/// A program on the other end of three pipes. POSIX only.

#include <sys/types.h>
#include <chrono>
#include <cstddef>
#include <span>
#include <string>

namespace cnerf {

/// What went wrong while talking to a child.
enum class ChildTrouble {
  kNone,
  kTimedOut,  ///< no answer in time; the process group was killed
  kEnded,     ///< the program closed its output or died before it had answered
};

class ChildProcess {
 public:
  using Deadline = std::chrono::steady_clock::time_point;

  /// Starts `/bin/sh -c command` as the leader of a process group of its own, in the current folder.
  /// @throws ColorizerError  when it cannot be started.
  explicit ChildProcess(const std::string& command);
  /// Closes the program's input, gives it a moment to end, then kills its process group.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Both move every byte or report trouble; what the program says on stderr is passed through meanwhile. A program
  /// that stops reading gives kEnded, never SIGPIPE.
  ChildTrouble write_all(std::span<const std::byte> bytes, Deadline deadline);
  ChildTrouble read_all(std::span<std::byte> bytes, Deadline deadline);

  /// The last lines of stderr, ready to be appended to a message; empty when there were none.
  [[nodiscard]] std::string last_words();
  /// "exited with 3", "was killed by signal 11", "is still running".
  [[nodiscard]] std::string fate();
  void kill_group();

 private:
  void drain_errors();
  bool wait_for(int fd, short events, Deadline deadline);
  bool reap(bool wait);

  pid_t pid_ = -1;
  int input_ = -1, output_ = -1, errors_ = -1;  // our ends
  bool reaped_ = false;
  int status_ = 0;
  std::string stderr_tail_;
};

}  // namespace cnerf
