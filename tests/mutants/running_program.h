#pragma once
/// A program that goes on while others talk to it.

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace cnerf::mutants {

class RunningProgram {
 public:
  /// @param output  file for all it prints
  RunningProgram(const std::vector<std::string>& words, std::filesystem::path output);
  /// Kills it.
  ~RunningProgram();
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  [[nodiscard]] std::string printed() const;
  [[nodiscard]] bool is_alive();
  /// Sends SIGINT.  @return  its exit status as a shell reports it; nothing where it did not end in time
  std::optional<int> interrupt(std::chrono::seconds patience);

  [[nodiscard]] std::size_t resident_bytes() const;
  [[nodiscard]] std::size_t open_descriptors() const;

 private:
  pid_t pid_;
  std::filesystem::path output_;
  std::optional<int> status_;
};

}  // namespace cnerf::mutants
