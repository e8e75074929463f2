#include "tests/mutants/running_program.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <thread>

#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf::mutants {
namespace fs = std::filesystem;

RunningProgram::RunningProgram(const std::vector<std::string>& words, fs::path output) : output_(std::move(output)) {
  std::vector<std::string> texts = words;
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  write_file(output_, std::string_view());
  pid_ = ::fork();
  if (pid_ < 0) throw DeviceError("no process can be started");
  if (pid_ == 0) {
    ::setpgid(0, 0);
    const int file = ::open(output_.c_str(), O_WRONLY | O_APPEND);
    ::dup2(file, STDOUT_FILENO);
    ::dup2(file, STDERR_FILENO);
    ::close(file);
    ::execv(pointers[0], pointers.data());
    ::_exit(127);
  }
}

RunningProgram::~RunningProgram() {
  if (is_alive()) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
}

std::string RunningProgram::printed() const {
  return read_text_file(output_);
}

bool RunningProgram::is_alive() {
  int status = 0;
  if (!status_ && ::waitpid(pid_, &status, WNOHANG) == pid_) {
    status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  return !status_;
}

std::optional<int> RunningProgram::interrupt(std::chrono::seconds patience) {
  const auto end = std::chrono::steady_clock::now() + patience;
  if (is_alive()) ::kill(pid_, SIGINT);
  while (is_alive() && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  return status_;
}

std::size_t RunningProgram::resident_bytes() const {
  std::ifstream statm("/proc/" + std::to_string(pid_) + "/statm");
  std::size_t pages = 0;
  statm >> pages >> pages;
  return pages * std::size_t(::sysconf(_SC_PAGESIZE));
}

std::size_t RunningProgram::open_descriptors() const {
  std::size_t count = 0;
  std::error_code failure;
  for (fs::directory_iterator entry("/proc/" + std::to_string(pid_) + "/fd", failure), end; entry != end;
       entry.increment(failure)) {
    ++count;
  }
  return count;
}

}  // namespace cnerf::mutants
