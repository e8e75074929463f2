#pragma once
/// The types of errors and their exit codes. `main`, the Python module and the studio turn them into messages;
/// only `main` exits the program.

#include <filesystem>
#include <stdexcept>
#include <string>

namespace cnerf {

/// Exit codes of the program. The numbers follow sysexits.h where it has a fitting one.
enum class ExitCode : int {
  kSuccess = 0,
  kUsage = 64,         ///< unknown option or config key, value out of range
  kInput = 65,         ///< a file's content is wrong (poses, images, models), or it cannot be read
  kMissingInput = 66,  ///< a file or folder that should exist does not
  kDevice = 69,        ///< a device that was asked for is not there, or failed
  kInternal = 70,      ///< our own contract was broken: a bug
  kMemory = 71,        ///< memory did not suffice
  kOutput = 73,        ///< the output cannot be written: permissions, full disk
  kRanks = 74,         ///< another process of the same launch died, stopped, failed or cannot be reached
  kBusy = 75,          ///< another cnerf works in the same folder; later it may go
  kColorizer = 76,     ///< a colorizer failed, timed out or answered nonsense
  kPoses = 77,         ///< no camera poses can be found: no overlap, no parallax, too few views placed
  kSnapshot = 78,      ///< a snapshot of another version or training, or cut short
  kDiverged = 79,      ///< training ran into numbers that are not finite; the last good snapshot is kept
  kInterrupted = 130,  ///< Ctrl-C; what can go on was saved
};

/// Base of every error the user should read.
class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  [[nodiscard]] ExitCode exit_code() const { return code_; }

 private:
  ExitCode code_;
};

/// A command line or config value the program does not accept.
struct UsageError : Error {
  explicit UsageError(const std::string& message) : Error(ExitCode::kUsage, message) {}
};

/// A file whose content is wrong. The message reads `file: field: what was expected, what was found`.
struct InputError : Error {
  explicit InputError(const std::string& message) : Error(ExitCode::kInput, message) {}
  InputError(const std::filesystem::path& file, const std::string& field, const std::string& problem);
};

/// A file or folder that should exist does not.
struct MissingInputError : Error {
  explicit MissingInputError(const std::string& message) : Error(ExitCode::kMissingInput, message) {}
};

/// A device that is missing, or a driver call that failed.
struct DeviceError : Error {
  explicit DeviceError(const std::string& message) : Error(ExitCode::kDevice, message) {}
};

/// An output that cannot be written. Nothing half-written is left under the final name.
struct OutputError : Error {
  explicit OutputError(const std::string& message) : Error(ExitCode::kOutput, message) {}
};

/// Another process that a launcher started together with this one died, stopped, failed or cannot be reached.
struct RankError : Error {
  explicit RankError(const std::string& message) : Error(ExitCode::kRanks, message) {}
};

/// A folder that another process of this program works in.
struct BusyError : Error {
  explicit BusyError(const std::string& message) : Error(ExitCode::kBusy, message) {}
};

/// A colorizer that failed, hung or answered with wrong shapes or values.
struct ColorizerError : Error {
  explicit ColorizerError(const std::string& message) : Error(ExitCode::kColorizer, message) {}
};

/// Photographs or a clip whose camera poses cannot be found. The message says why and what may help.
struct PosesError : Error {
  explicit PosesError(const std::string& message) : Error(ExitCode::kPoses, message) {}
};

/// A snapshot this program cannot continue from.
struct SnapshotError : Error {
  explicit SnapshotError(const std::string& message) : Error(ExitCode::kSnapshot, message) {}
};

/// A training whose loss or parameters are no longer finite.
struct DivergedError : Error {
  explicit DivergedError(const std::string& message) : Error(ExitCode::kDiverged, message) {}
};

/// Raised after the state was saved when the user pressed Ctrl-C.
struct Interrupted : Error {
  explicit Interrupted(const std::string& message) : Error(ExitCode::kInterrupted, message) {}
};

/// What the standard library's own error of a file means. Outputs fail by OutputError, so one without permission is an
/// input.
[[nodiscard]] ExitCode exit_code_of(const std::filesystem::filesystem_error& error);

/// A violated precondition inside this program: always a bug.
class ContractError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

}  // namespace cnerf
