#pragma once
/// Calls the program under test.

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/support/tiny_options.h"

namespace cnerf::test {

struct ProgramResult {
  int exit_code = 0;
  std::string out;  ///< standard output
  std::string err;  ///< standard error
};

/// Its path.
[[nodiscard]] std::string program();

/// Runs cnerf with these arguments and waits for it. It sees no GPU, whatever the machine has.
[[nodiscard]] ProgramResult cnerf(const std::vector<std::string>& arguments);

/// As `cnerf`, and sends SIGINT once standard output holds `text`.
[[nodiscard]] ProgramResult cnerf_interrupted_at(const std::vector<std::string>& arguments, const std::string& text);

/// As `cnerf`, where no file may grow beyond `bytes`: what a full disk looks like from inside.
[[nodiscard]] ProgramResult cnerf_with_file_limit(const std::vector<std::string>& arguments, std::size_t bytes);

/// What many tests begin with. CTest makes each once for all processes (e2e_fixture) and names their folder in
/// $CNERF_E2E; without it a process makes what it asks for itself. Tests copy what they change.
/// @{
[[nodiscard]] const std::filesystem::path& tiny_capture();  ///< a sample capture of few, small views
[[nodiscard]] const std::filesystem::path& tiny_run();      ///< a grey run of it
[[nodiscard]] const std::filesystem::path& tiny_take();     ///< that run, with a take "grey"
[[nodiscard]] const std::filesystem::path& tiny_bake();     ///< its volume
/// @}

/// A copy of a folder, `to`.
std::filesystem::path copied(const std::filesystem::path& from, const std::filesystem::path& to);

/// All files below a folder, relative, sorted.
[[nodiscard]] std::vector<std::string> files_below(const std::filesystem::path& folder);

/// `a` followed by `b`.
[[nodiscard]] std::vector<std::string> concatenated(std::vector<std::string> a, const std::vector<std::string>& b);

}  // namespace cnerf::test
