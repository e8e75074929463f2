#pragma once
/// Runs the program, with faults where they are wanted, and looks at what it left.

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace cnerf::faults {

/// What the preloaded file layer is to do; see shim.cpp.
struct Plan {
  std::string kind;  ///< "" = nothing is preloaded
  long at = 0;       ///< number of the operation
  bool at_end = false;
  int milliseconds = 0;  ///< of a slow write
};

struct Ending {
  int code = 0;  ///< exit code; -n after signal n
  bool hung = false;
  bool was_stopped = false;  ///< by us
  std::string said;          ///< output and errors
  double seconds = 0;
};

/// Sends a signal to a running program once `is_time` says so; asked every few milliseconds.
struct Stop {
  int signal = 0;
  std::function<bool(double seconds)> is_time;
};

/// The program under test and the library preloaded into it.
struct Subject {
  std::filesystem::path program, shim;
  std::chrono::seconds patience{180};  ///< then it hangs
};

/// A folder in which trials happen, one after the other: `root()` is what the program works in.
class Slot {
 public:
  Slot(const std::filesystem::path& scratch, int number);
  [[nodiscard]] std::filesystem::path root() const { return folder_ / "root"; }
  /// Empty again.
  void clear() const;
  /// Runs the program with these words, where "@" stands for the root.
  Ending run(const Subject& subject, const std::vector<std::string>& words, const Plan& plan = {},
             const Stop& stop = {}, const std::string& output = "output") const;
  /// Of the last run with a plan: operations as (what, path); of allocations the number alone.
  struct Operation {
    std::string what, path;
    std::size_t bytes = 0;
  };
  [[nodiscard]] std::vector<Operation> operations() const;
  /// Keeps what is there for somebody to look at, with a text.  @return  where.
  [[nodiscard]] std::filesystem::path keep(const std::string& name, const std::string& text) const;

 private:
  std::filesystem::path scratch_, folder_;
};

/// Files below a folder, relative, and a digest of what they hold, but what may differ between two runs that did the
/// same:
///   *.vdb               bytes 21 to 56: the identifier that OpenVDB draws at random
///   *.json, *.html, *.md: names of the slot; in JSON the keys of `varying_keys()`, and checksums of volume.vdb
///                       and blender_setup.py
///   accepted.png, rejected.png: of a take, they show answers since it began or went on
/// Empty folders are none.
using Content = std::map<std::string, std::string>;
constexpr const char* kNoJson = "no JSON, ";  ///< in front of the digest of a .json that is none
[[nodiscard]] Content content_of(const std::filesystem::path& folder);
/// Keys of JSON files that hold times, memory, and the command line, which has --resume the second time.
[[nodiscard]] const std::vector<std::string>& varying_keys();

/// Names of files that differ or are in one alone; "" when there are none.
[[nodiscard]] std::string difference(const Content& found, const Content& expected);
/// Temporary files, locks, journals: hidden ones and *.bake.
[[nodiscard]] std::string leftovers(const Content& content);

}  // namespace cnerf::faults
