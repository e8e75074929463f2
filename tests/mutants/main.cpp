/// cnerf-mutants: files that were changed at random, read by the program. Ends with 1 where the program did not stand
/// one of them.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "src/base/error.h"
#include "tests/mutants/campaign.h"

int main(int argc, char** argv) {
  using namespace cnerf::mutants;
  CampaignOptions options;
  options.program = CNERF_PROGRAM;
  options.folder = "mutants";
  options.say = [](const std::string& line) { fmt::print(stderr, "{}\n", line); };
  std::size_t memory = options.most_memory >> 20;
  int seconds = int(options.limits.wall.count());
  CLI::App app{"Mutants of every kind of file cnerf reads, and what it says to them"};
  app.add_option("--seed", options.seed, "Of the generator")->capture_default_str();
  app.add_option("--per-kind", options.per_kind, "Mutants of each kind of file")->capture_default_str();
  app.add_option("--kinds", options.kinds, "Names of kinds, or how they begin; all if not given");
  app.add_option("--number", options.number, "Only this mutant of each kind, as a report of a violation says");
  app.add_option("--program", options.program, "The cnerf to test")->capture_default_str();
  app.add_option("--folder", options.folder, "For originals, violations and the lists")->capture_default_str();
  app.add_option("-j,--jobs", options.jobs, "Programs at a time")->capture_default_str();
  app.add_option("--memory", memory, "MiB a program may hold")->capture_default_str();
  app.add_option("--seconds", seconds, "A command may take")->capture_default_str();
  app.add_flag("--asan", options.limits.sanitized, "The program is built with the address sanitizer");
  CLI11_PARSE(app, argc, argv);
  options.program = std::filesystem::absolute(options.program);
  options.folder = std::filesystem::absolute(options.folder);
  options.most_memory = memory << 20;
  options.limits.wall = std::chrono::seconds(seconds);
  if (options.limits.sanitized) options.limits.address_bytes = 0;
  try {
    const std::vector<Row> rows = run_campaign(options);
    std::size_t violations = 0;
    for (const Row& row : rows) violations += row.violations();
    fmt::print("{}\n{} violations; they lie in {}\n", table_of(rows), violations,
               (options.folder / "violations").string());
    return violations > 0 ? 1 : 0;
  } catch (const cnerf::Error& error) {
    fmt::print(stderr, "cnerf-mutants: {}\n", error.what());
    return int(error.exit_code());
  }
}
