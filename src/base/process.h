#pragma once
/// Child processes: finding a program, running it to its end, talking to it over pipes. POSIX only.

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <deque>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/base/file_descriptor.h"

namespace cnerf {

/// The executable `name`, searched for on $PATH unless it contains a slash; nothing when there is none.
[[nodiscard]] std::optional<std::filesystem::path> find_program(const std::string& name);

/// Runs `words` (the program and its arguments; no shell) with stdout and stderr appended to `log`, without input or
/// display. `watch` is called a few times per second meanwhile; when it throws, the program and its children are killed
/// and the exception is rethrown.
/// @return  its exit status; 128 + n when signal n killed it.
/// @throws OutputError  when the log cannot be written.  @throws DeviceError  when the program cannot be started.
int run_program(const std::vector<std::string>& words, const std::filesystem::path& log,
                const std::function<void()>& watch = {});

/// What `attempt` fails with in a child of this process, so that it need not be made in this one: libraries that read
/// what others made may crash, hang or swell.
/// @param attempt  must not need threads, which a child does not have; what it writes to standard error is lost
/// @param memory   bytes that the child may take besides what this process holds
/// @return  what it threw; "" where it crashed, time or memory did not suffice, or how it ended was lost; nullopt where
///          it returned, and where there can be no child
/// @throws std::bad_alloc  where the limit of this process's own memory did not suffice (limit_memory)
[[nodiscard]] std::optional<std::string> failure_in_child(const std::function<void()>& attempt, double seconds,
                                                          std::size_t memory);

/// A running program in a process group of its own: Ctrl-C reaches it through us only.
class Process {
 public:
  /// Descriptors that become its standard streams.
  struct Streams {
    int input, output, errors;
  };
  /// @param variables  "NAME=value", over those of our environment.  @throws DeviceError  when it cannot be started.
  Process(std::vector<std::string> words, const Streams& streams, const std::vector<std::string>& variables = {});
  /// Kills the group.
  ~Process() { kill_group(); }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  /// Its exit status as a shell reports it, 128 + n after signal n; nothing while it runs. Waits at most `patience`.
  std::optional<int> exit_status(std::chrono::milliseconds patience = {});
  /// "exited with 3", "was killed by signal 11", "is still running".
  [[nodiscard]] std::string fate();
  /// Kills it and its children.
  void kill_group();

 private:
  bool has_ended(int options);

  pid_t pid_ = -1;
  bool ended_ = false;
  int status_ = 0;  // of waitpid
};

/// What went wrong while talking to a program.
enum class PipeTrouble {
  kNone,
  kTimedOut,  ///< no answer in time
  kEnded,     ///< the program closed its output or died before it had answered
};

/// A program on the other end of three pipes.
class PipedProcess {
 public:
  using Deadline = std::chrono::steady_clock::time_point;

  /// Starts `/bin/sh -c command` in the current folder.  @throws DeviceError  when it cannot be started.
  explicit PipedProcess(const std::string& command);
  /// Closes the program's input, gives it a moment to end, then kills its process group.
  ~PipedProcess();

  /// Both transfer every byte or report trouble; the program's stderr is passed through meanwhile. A program that stops
  /// reading gives kEnded, never SIGPIPE; one that answers before it has read all is listened to.
  PipeTrouble write_all(std::span<const std::byte> bytes, Deadline deadline);
  PipeTrouble read_all(std::span<std::byte> bytes, Deadline deadline);

  /// Whether it wrote something that nobody has read yet.
  [[nodiscard]] bool has_unread_output() const;
  /// The last lines of stderr, ready to be appended to a message; empty when there were none.
  [[nodiscard]] std::string last_words();
  [[nodiscard]] Process& process() { return *process_; }

 private:
  void drain_errors();
  void hear_early_answer();
  bool wait_for(int descriptor, short events, Deadline deadline);

  FileDescriptor input_, output_, errors_;  // our ends
  std::optional<Process> process_;
  std::string stderr_tail_;
  std::deque<std::byte> early_;   // of its output, heard while it was written to
  bool may_answer_early_ = true;  // until it closes its output, or floods us
};

/// Quotes a text as one word of the shell.
[[nodiscard]] std::string shell_word(const std::string& text);

}  // namespace cnerf
