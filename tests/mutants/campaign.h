#pragma once
/// Mutants of files, read by the program: what it says to them, and whether it stands them.

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tests/mutants/originals.h"

namespace cnerf::mutants {

struct CampaignOptions {
  std::uint64_t seed = 1;
  std::size_t per_kind = 200;
  std::vector<std::string> kinds;     ///< names, or how they begin; empty = all
  std::optional<std::size_t> number;  ///< only this mutant of each kind
  std::filesystem::path program, folder;
  Limits limits;
  std::size_t most_memory = std::size_t(1500) << 20;  ///< resident bytes; a sanitized program is not measured
  int jobs = 2;
  std::function<void(const std::string&)> say = [](const std::string&) {};
};

enum class Verdict {
  kRefused,   ///< with a documented exit code, the file named
  kAccepted,  ///< all commands ended with 0
  kUnnamed,   ///< refused, and the message does not name the file
  kCrash,     ///< a signal, or a sanitizer's report
  kHang,
  kInternal,  ///< exit code 70, or one that is not documented
  kMemory,
};
inline constexpr std::size_t kVerdicts = 7;

struct Row {
  std::string kind;
  std::array<std::size_t, kVerdicts> counts{};
  double seconds = 0;          ///< of all runs
  std::size_t peak_bytes = 0;  ///< the most of one
  [[nodiscard]] std::size_t of(Verdict verdict) const { return counts[std::size_t(verdict)]; }
  [[nodiscard]] std::size_t violations() const;
};

/// Runs it. `folder` then holds `originals`, `violations/KIND-NUMBER` (the mutant, the command, what it printed),
/// `accepted.txt` (a line for each) and `table.txt`.
/// @throws Error  when an original cannot be made or is refused; UsageError for a kind there is not.
[[nodiscard]] std::vector<Row> run_campaign(const CampaignOptions& options);

/// In Markdown, with a sum.
[[nodiscard]] std::string table_of(const std::vector<Row>& rows);

/// What the program's end means.  @param file  the name of the mutated one
[[nodiscard]] Verdict verdict_of(const Outcome& outcome, const std::string& file, const CampaignOptions& options);

}  // namespace cnerf::mutants
