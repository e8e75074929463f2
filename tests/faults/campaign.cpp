/// cnerf-fault-campaign: disturbs the program in many ways and judges what it leaves. Prints tables in Markdown and
/// ends with 1 when anything was violated; what was is kept below the folder.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <string>

#include "tests/faults/campaigns.h"

int main(int argc, char** argv) {
  using namespace cnerf::faults;
  CLI::App app{"Disturbs cnerf and judges what it leaves", "cnerf-fault-campaign"};
  CampaignOptions options;
  options.subject = {CNERF_PROGRAM, CNERF_FAULT_SHIM};
  options.scratch = std::filesystem::temp_directory_path() / "cnerf-faults";
  const std::map<std::string, Report (*)(const CampaignOptions&)> campaigns = {
      {"operations", disturb_operations}, {"kills", kill_at_random}, {"pairs", run_pairs}, {"allocations", starve}};
  app.add_option("CAMPAIGN", "operations, kills, pairs or allocations")
      ->required()
      ->check(CLI::IsMember({"operations", "kills", "pairs", "allocations"}));
  app.add_option("--program", options.subject.program, "The cnerf to disturb");
  app.add_option("--folder", options.scratch, "Folder for everything; what was violated is kept there");
  app.add_option("--seed", options.seed, "Of all that is drawn");
  app.add_option("--count", options.count, "Trials of kills (500) and pairs (200)");
  app.add_option("--every", options.every, "Only every K-th operation or allocation")->check(CLI::PositiveNumber);
  app.add_option_function<std::string>(
      "--part",
      [&options](const std::string& text) {
        if (std::sscanf(text.c_str(), "%d/%d", &options.part, &options.parts) != 2 || options.part < 1 ||
            options.part > options.parts) {
          throw CLI::ValidationError("--part", "expected I/N with I from 1 to N, found " + text);
        }
      },
      "I/N: of all trials only the I-th of each N, to share them out");
  app.add_option("--commands", options.commands, "Only these, comma-separated")->delimiter(',');
  app.add_option("--kinds", options.kinds, "Of operations: only eio, enospc, edquot, short, kill, power, power-names")
      ->delimiter(',');
  app.add_option("--memory-code", options.out_of_memory, "Exit codes that mean out of memory [69,71]")->delimiter(',');
  int patience = int(options.subject.patience.count());
  app.add_option("--patience", patience, "Seconds after which a program hangs; more on a busy machine")
      ->capture_default_str();
  app.add_option("-j,--jobs", options.jobs, "Trials at a time")->check(CLI::Range(1, 7));
  CLI11_PARSE(app, argc, argv);
  const std::string campaign = app.get_option("CAMPAIGN")->as<std::string>();
  options.subject.patience = std::chrono::seconds(patience);
  if (options.count == 0) options.count = campaign == "kills" ? 500 : 200;
  try {
    options.subject.program = std::filesystem::absolute(options.subject.program);
    const Report report = campaigns.at(campaign)(options);
    std::printf("## %s, seed %llu\n\n%s", campaign.c_str(), static_cast<unsigned long long>(options.seed),
                report.text().c_str());
    return report.violations.empty() ? 0 : 1;
  } catch (const std::exception& failure) {
    std::fprintf(stderr, "cnerf-fault-campaign: %s\n", failure.what());
    return 2;
  }
}
