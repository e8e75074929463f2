#include "src/base/program.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <thread>

#include "src/base/error.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr std::chrono::milliseconds kBetweenLooks{50};

bool is_executable(const fs::path& file) {
  std::error_code failure;
  return fs::is_regular_file(file, failure) && ::access(file.c_str(), X_OK) == 0;
}

/// Our environment, with Qt told that there is no screen: some programs link it and need none.
std::vector<std::string> headless_environment() {
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    if (std::strncmp(*variable, "QT_QPA_PLATFORM=", 16) != 0) variables.emplace_back(*variable);
  }
  variables.emplace_back("QT_QPA_PLATFORM=offscreen");
  return variables;
}

std::vector<char*> pointers_to(std::vector<std::string>& words) {
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return pointers;
}

/// Starts the program as the leader of a process group of its own, so that Ctrl-C reaches it through us only.
pid_t spawn(std::vector<std::string> words, int log) {
  std::vector<std::string> variables = headless_environment();
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, log, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, log, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t pid = -1;
  const int failure = ::posix_spawnp(&pid, words.front().c_str(), &actions, &attributes, pointers_to(words).data(),
                                     pointers_to(variables).data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (failure != 0) throw DeviceError(words.front() + ": cannot be started: " + std::strerror(failure));
  return pid;
}

/// The status of an ended child; nothing while it runs.
std::optional<int> ended(pid_t pid, int options) {
  int status = 0;
  pid_t found = 0;
  do {
    found = ::waitpid(pid, &status, options);
  } while (found == -1 && errno == EINTR);
  if (found != pid) return std::nullopt;
  return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

class OpenLog {
 public:
  explicit OpenLog(const fs::path& file)
      : descriptor_(::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644)) {
    if (descriptor_ < 0) throw OutputError(file.string() + ": cannot be written: " + std::strerror(errno));
  }
  ~OpenLog() { ::close(descriptor_); }
  OpenLog(const OpenLog&) = delete;
  OpenLog& operator=(const OpenLog&) = delete;
  [[nodiscard]] int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
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

int run_program(const std::vector<std::string>& words, const fs::path& log, const std::function<void()>& watch) {
  const OpenLog output(log);
  const pid_t pid = spawn(words, output.descriptor());
  try {
    for (;;) {
      if (const auto status = ended(pid, WNOHANG)) return *status;
      if (watch) watch();
      std::this_thread::sleep_for(kBetweenLooks);
    }
  } catch (...) {
    ::kill(-pid, SIGKILL);
    (void)ended(pid, 0);
    throw;
  }
}

}  // namespace cnerf
