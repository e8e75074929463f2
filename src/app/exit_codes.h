#pragma once
/// The exit codes with what they mean, as --help and the manual list them.

#include <array>
#include <string>

#include "src/base/error.h"

namespace cnerf::app {

struct ExitCodeMeaning {
  ExitCode code;
  const char* meaning;
};

inline constexpr std::array<ExitCodeMeaning, 15> kExitCodes = {{
    {ExitCode::kSuccess, "success"},
    {ExitCode::kUsage, "unknown option or config key, value out of range"},
    {ExitCode::kInput, "a file's content is wrong, or it cannot be read"},
    {ExitCode::kMissingInput, "a file or folder that should exist does not"},
    {ExitCode::kDevice, "a device or a program that is needed is missing, or failed"},
    {ExitCode::kInternal, "a bug in cnerf"},
    {ExitCode::kMemory, "memory did not suffice"},
    {ExitCode::kOutput, "the output cannot be written"},
    {ExitCode::kRanks, "another process of the same launch ended early or cannot be reached"},
    {ExitCode::kBusy, "another cnerf works in the same folder"},
    {ExitCode::kColorizer, "a colorizer failed, timed out or answered nonsense"},
    {ExitCode::kPoses, "no camera poses can be found"},
    {ExitCode::kSnapshot, "a snapshot of another version or training, or cut short"},
    {ExitCode::kDiverged, "training diverged; the last good snapshot is kept"},
    {ExitCode::kInterrupted, "stopped by Ctrl-C; what can go on goes on with --resume"},
}};

/// The footer of `cnerf --help`.
[[nodiscard]] inline std::string exit_codes_text() {
  std::string text = "Exit codes:\n";
  for (const auto& [code, meaning] : kExitCodes) {
    const std::string number = std::to_string(int(code));
    text += "  " + std::string(3 - number.size(), ' ') + number + "  " + meaning + "\n";
  }
  return text;
}

}  // namespace cnerf::app
