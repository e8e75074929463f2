#include "tests/mutants/campaign.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <mutex>
#include <set>
#include <thread>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/process.h"
#include "tests/mutants/mutate.h"

namespace cnerf::mutants {
namespace {
namespace fs = std::filesystem;

/// Those of src/base/error.h that a file may end the program with.
constexpr std::array kDocumented = {64, 65, 66, 69, 71, 73, 75, 76, 77, 78, 79};
constexpr std::array<const char*, kVerdicts> kNames = {"refused", "accepted", "unnamed", "crash",
                                                       "hang",    "exit 70",  "memory"};

bool is_violation(Verdict verdict) {
  return verdict != Verdict::kRefused && verdict != Verdict::kAccepted;
}

bool holds(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

std::string last_line(const std::string& text) {
  const std::size_t end = text.find_last_not_of(" \r\n\t");
  if (end == std::string::npos) return "";
  const std::size_t begin = text.find_last_of("\r\n", end);
  return text.substr(begin == std::string::npos ? 0 : begin + 1, end - (begin == std::string::npos ? -1 : begin));
}

/// One line of printable characters.
std::string plain(std::string text, std::size_t most) {
  if (text.size() > most) text = text.substr(0, most) + "...";
  for (char& c : text) {
    if (std::uint8_t(c) < 32 || std::uint8_t(c) > 126) c = '?';
  }
  return text;
}

std::string file_name_of(const std::string& kind, std::size_t number) {
  std::string name = kind;
  for (char& c : name) {
    if (std::isalnum(std::uint8_t(c)) == 0 && c != '.') c = '_';
  }
  return fmt::format("{}-{}", name, number);
}

std::vector<std::string> words_of(const Step& step, const CampaignOptions& options, const fs::path& stage) {
  std::vector<std::string> words = {options.program.string()};
  for (std::string word : step.arguments) {
    if (const std::size_t at = word.find("{}"); at != std::string::npos) word.replace(at, 2, stage.string());
    words.push_back(word);
  }
  return words;
}

/// A mutant of a kind: of the whole file, or of what lies behind its checksum.
Mutant mutant_of(const Kind& kind, const std::string& original, Random& random, bool is_signed) {
  const auto mutate = [&](const std::string& bytes, bool is_text) {
    return is_text ? mutate_text(bytes, random) : mutate_bytes(bytes, random);
  };
  std::optional<Envelope> envelope = is_signed ? opened(kind.format, original) : std::nullopt;
  if (!envelope) return mutate(original, kind.is_text);
  const std::size_t which = random.below(envelope->sections.size());
  Section& section = envelope->sections[which];
  Mutant mutant = mutate(section.bytes, section.is_text);
  section.bytes = mutant.bytes;
  return {envelope->seal(envelope->sections), fmt::format("part {}: {}; checksum fits", which, mutant.change)};
}

/// What became of one mutant.
struct Finding {
  Verdict verdict = Verdict::kAccepted;
  std::string change, said;
  std::vector<std::string> command;
  Outcome outcome;
  double seconds = 0;
  std::size_t peak_bytes = 0;
};

class Campaign {
 public:
  explicit Campaign(const CampaignOptions& options) : options_(options) {
    const Workshop workshop{options.program, options.folder / "originals", options.limits};
    for (Kind& kind : make_originals(workshop)) {
      if (is_wanted(kind)) kinds_.push_back(std::move(kind));
    }
    if (kinds_.empty()) throw UsageError("--kinds: no kind begins like that");
    fs::remove_all(options.folder / "violations");
    accepted_.open(options.folder / "accepted.txt");
  }

  std::vector<Row> run() {
    for (const Kind& kind : kinds_) rows_.push_back({kind.name});
    check_originals();
    std::atomic<std::size_t> next = 0;
    std::vector<std::thread> workers;
    for (int worker = 0; worker < options_.jobs; ++worker) {
      workers.emplace_back([&, worker] {
        const fs::path folder = options_.folder / "work" / std::to_string(worker);
        for (std::size_t task; (task = next++) < kinds_.size() * options_.per_kind;) {
          const std::size_t kind = task / options_.per_kind, number = task % options_.per_kind;
          if (!options_.number || *options_.number == number)
            add(kind, number, read_mutant(kinds_[kind], number, folder), folder);
        }
        fs::remove_all(folder);
      });
    }
    for (std::thread& worker : workers) worker.join();
    write_file(options_.folder / "table.txt", table_of(rows_));
    return rows_;
  }

 private:
  [[nodiscard]] bool is_wanted(const Kind& kind) const {
    return options_.kinds.empty() ||
           std::ranges::any_of(options_.kinds, [&](const std::string& name) { return kind.name.starts_with(name); });
  }

  /// A campaign on files that are refused anyhow would prove nothing.
  void check_originals() {
    const fs::path folder = options_.folder / "work/original";
    std::set<std::vector<std::string>> read_already;  // stages and commands, which files may have in common
    for (const Kind& kind : kinds_) {
      std::vector<std::string> reading = {kind.stage.string()};
      for (const Step& step : kind.steps) {
        reading.insert(reading.end(), step.arguments.begin(), step.arguments.end());
        reading.push_back(step.interrupt_at);
      }
      if (!read_already.insert(reading).second) continue;
      const Finding finding = read(kind, read_text_file(kind.stage / kind.file), false, folder);
      if (finding.verdict == Verdict::kAccepted) continue;
      throw InputError(kind.stage / kind.file, kind.name,
                       fmt::format("the original is not accepted: exit code {}: {}", finding.outcome.exit_code,
                                   finding.outcome.err));
    }
    fs::remove_all(folder);
  }

  Finding read_mutant(const Kind& kind, std::size_t number, const fs::path& folder) const {
    Random random(options_.seed, kind.name, number);
    const bool is_signed = random.chance(2);
    const Mutant mutant = mutant_of(kind, read_text_file(kind.stage / kind.file), random, is_signed);
    Finding finding = read(kind, mutant.bytes, is_signed, folder);
    finding.change = mutant.change + (is_signed && kind.amend ? "; manifest fits" : "");
    return finding;
  }

  /// Lays the file into a copy of its stage and runs what reads it.
  Finding read(const Kind& kind, const std::string& bytes, bool is_signed, const fs::path& folder) const {
    const fs::path stage = folder / "stage";
    fs::remove_all(stage);
    fs::create_directories(folder);
    fs::copy(kind.stage, stage, fs::copy_options::recursive);
    fs::remove(stage / kind.file);
    std::ofstream(stage / kind.file, std::ios::binary) << bytes;
    if (is_signed && kind.amend) kind.amend(stage);
    Finding finding;
    for (const Step& step : kind.steps) {
      finding.command = words_of(step, options_, stage);
      finding.outcome = run_limited(finding.command, folder / "output", options_.limits, step.interrupt_at);
      finding.seconds += finding.outcome.seconds;
      finding.peak_bytes = std::max(finding.peak_bytes, finding.outcome.peak_bytes);
      finding.verdict = verdict_of(finding.outcome, kind.file.filename().string(), options_);
      finding.said = last_line(finding.outcome.err.empty() ? finding.outcome.out : finding.outcome.err);
      if (finding.verdict != Verdict::kAccepted) break;
    }
    return finding;
  }

  void add(std::size_t kind, std::size_t number, const Finding& finding, const fs::path& folder) {
    const std::lock_guard guard(mutex_);
    Row& row = rows_[kind];
    ++row.counts[std::size_t(finding.verdict)];
    row.seconds += finding.seconds;
    row.peak_bytes = std::max(row.peak_bytes, finding.peak_bytes);
    const std::string name = fmt::format("{} {}", row.kind, number);
    if (finding.verdict == Verdict::kAccepted) {
      accepted_ << fmt::format("{} | {} | {}\n", name, plain(finding.change, 160), plain(finding.said, 160))
                << std::flush;
    }
    if (is_violation(finding.verdict)) keep(kinds_[kind], number, finding, folder);
    if (++finished_ % 200 == 0)
      options_.say(fmt::format("{} of {} mutants", finished_, kinds_.size() * options_.per_kind));
  }

  /// The mutant and all that is needed to see it again.
  void keep(const Kind& kind, std::size_t number, const Finding& finding, const fs::path& folder) {
    const fs::path kept = options_.folder / "violations" / file_name_of(kind.name, number);
    fs::create_directories(kept);
    fs::copy_file(folder / "stage" / kind.file, kept / kind.file.filename(), fs::copy_options::overwrite_existing);
    std::string command;
    for (const std::string& word : finding.command) command += (command.empty() ? "" : " ") + shell_word(word);
    write_file(kept / "report.txt",
               fmt::format("verdict: {}\nkind: {}\nagain: --seed {} --kinds {} --number {}\nchange: {}\ncommand: {}\n"
                           "exit code: {}\nsignal: {}\ntimed out: {}\nseconds: {:.2f}\npeak MiB: {}\n\n{}\n{}\n",
                           kNames[std::size_t(finding.verdict)], kind.name, options_.seed, shell_word(kind.name),
                           number, plain(finding.change, 400), command, finding.outcome.exit_code,
                           finding.outcome.signal, finding.outcome.timed_out, finding.outcome.seconds,
                           finding.outcome.peak_bytes >> 20, finding.outcome.err, finding.outcome.out));
    options_.say(fmt::format("{}: {} {}: {}", kNames[std::size_t(finding.verdict)], kind.name, number,
                             plain(finding.said, 200)));
  }

  CampaignOptions options_;
  std::vector<Kind> kinds_;
  std::vector<Row> rows_;
  std::ofstream accepted_;
  std::mutex mutex_;
  std::size_t finished_ = 0;
};

}  // namespace

std::size_t Row::violations() const {
  std::size_t sum = 0;
  for (std::size_t i = 0; i < kVerdicts; ++i) sum += is_violation(Verdict(i)) ? counts[i] : 0;
  return sum;
}

Verdict verdict_of(const Outcome& outcome, const std::string& file, const CampaignOptions& options) {
  const bool is_reported = holds(outcome.err, "ERROR: AddressSanitizer") || holds(outcome.err, "runtime error:");
  if (outcome.timed_out) return Verdict::kHang;
  if (holds(outcome.err, "hard rss limit exhausted")) return Verdict::kMemory;
  if (outcome.signal != 0 || is_reported) return Verdict::kCrash;
  if (!options.limits.sanitized && outcome.peak_bytes > options.most_memory) return Verdict::kMemory;
  if (outcome.exit_code == 0) return Verdict::kAccepted;
  if (std::ranges::find(kDocumented, outcome.exit_code) == kDocumented.end()) return Verdict::kInternal;
  return holds(outcome.err, file) ? Verdict::kRefused : Verdict::kUnnamed;
}

std::vector<Row> run_campaign(const CampaignOptions& options) {
  return Campaign(options).run();
}

std::string table_of(const std::vector<Row>& rows) {
  std::string table =
      "| target | mutants | refused | accepted | crash | hang | exit 70 | memory | unnamed | seconds a mutant | peak "
      "MiB |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n";
  Row all{"**all**"};
  const auto add = [&](const Row& row) {
    std::size_t mutants = 0;
    for (const std::size_t count : row.counts) mutants += count;
    table += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.2f} | {} |\n", row.kind, mutants,
                         row.of(Verdict::kRefused) + row.of(Verdict::kUnnamed), row.of(Verdict::kAccepted),
                         row.of(Verdict::kCrash), row.of(Verdict::kHang), row.of(Verdict::kInternal),
                         row.of(Verdict::kMemory), row.of(Verdict::kUnnamed),
                         row.seconds / double(std::max<std::size_t>(1, mutants)), row.peak_bytes >> 20);
  };
  for (const Row& row : rows) {
    add(row);
    for (std::size_t i = 0; i < kVerdicts; ++i) all.counts[i] += row.counts[i];
    all.seconds += row.seconds;
    all.peak_bytes = std::max(all.peak_bytes, row.peak_bytes);
  }
  add(all);
  return table;
}

}  // namespace cnerf::mutants
