#pragma once
/// What a fault may do to the program, and what it may not: campaigns of many trials, each of which is judged.

#include <filesystem>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "tests/faults/commands.h"
#include "tests/faults/program_under_faults.h"

namespace cnerf::faults {

struct CampaignOptions {
  Subject subject;
  std::filesystem::path scratch;
  std::uint64_t seed = 1;
  int count = 0;                      ///< trials; of kills and pairs
  int every = 1;                      ///< stride over operations and allocations; where it begins is drawn by the seed
  std::vector<std::string> commands;  ///< none = all
  std::vector<std::string> kinds;     ///< of faults; none = all
  std::set<int> out_of_memory = {69, 71};
  int part = 1, parts = 1;  ///< of all trials, for many machines: the `part`-th of each `parts`
  int jobs = 2;
  bool is_quiet = false;
};

/// A row per command and kind of fault.
struct Tally {
  int trials = 0;
  std::map<std::string, int> endings;     ///< "0", "73", "-9": how often the disturbed program ended so
  std::map<std::string, int> violations;  ///< by what was violated
};

struct Violation {
  std::string row, what, where;  ///< `where`: the folder that is kept
};

struct Report {
  std::map<std::string, Tally> rows;
  std::vector<Violation> violations;
  std::vector<std::string> remarks;
  /// As a table in Markdown, and the violations.
  [[nodiscard]] std::string text() const;
};

/// Every operation of every command fails once in every way.
[[nodiscard]] Report disturb_operations(const CampaignOptions& options);
/// Commands are killed at random moments, every second one while a slow file layer writes.
[[nodiscard]] Report kill_at_random(const CampaignOptions& options);
/// Two commands in one folder at once.
[[nodiscard]] Report run_pairs(const CampaignOptions& options);
/// Large allocations fail.
[[nodiscard]] Report starve(const CampaignOptions& options);

}  // namespace cnerf::faults
