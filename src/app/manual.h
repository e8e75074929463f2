#pragma once
/// Man pages and completion of the command line, from the declarations that parse it.

#include <string>
#include <vector>

#include "src/app/command.h"

namespace cnerf::app {

/// What the pages say of their making.
struct ManualEdition {
  std::string version;  ///< "1.0.0"
  std::string date;     ///< "2024-05-31"
};

/// cnerf(1) in roff: the commands, the keys of --set, the exit codes.
[[nodiscard]] std::string program_page(const std::vector<ParsedCommand>& commands, const ManualEdition& edition);
/// cnerf-COMMAND(1) in roff: its arguments, every option of its --help, its examples.
[[nodiscard]] std::string command_page(const ParsedCommand& command, const ManualEdition& edition);

/// Scripts that complete commands, options, presets and keys of --set; anything else is completed as a file.
/// @{
[[nodiscard]] std::string bash_completion(const std::vector<ParsedCommand>& commands);
[[nodiscard]] std::string zsh_completion(const std::vector<ParsedCommand>& commands);
[[nodiscard]] std::string fish_completion(const std::vector<ParsedCommand>& commands);
/// @}

}  // namespace cnerf::app
