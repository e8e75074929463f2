/// cnerf-server-campaign: hostile, slow and many clients against the program's servers. Ends with 1 on a violation.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "src/base/error.h"
#include "tests/mutants/server_campaign.h"

int main(int argc, char** argv) {
  using namespace cnerf::mutants;
  ServerOptions options;
  options.program = CNERF_PROGRAM;
  options.folder = "server-campaign";
  options.say = [](const std::string& line) { fmt::print(stderr, "{}\n", line); };
  CLI::App app{"Clients that are hostile, slow or many, against cnerf view and cnerf train --view"};
  app.add_option("--seed", options.seed, "Of the generator")->capture_default_str();
  app.add_option("--program", options.program, "The cnerf to test")->capture_default_str();
  app.add_option("--folder", options.folder, "For what is served; emptied before")->capture_default_str();
  app.add_option("--slow", options.slow, "Sockets that send a byte a second")->capture_default_str();
  app.add_option("--silent", options.silent, "Sockets that send nothing")->capture_default_str();
  app.add_option("--streams", options.streams, "Followers of a training")->capture_default_str();
  app.add_option("--aborts", options.aborts, "Clients that go in the middle of an answer")->capture_default_str();
  app.add_option("--garbage", options.garbage, "Requests that are none")->capture_default_str();
  app.add_option("--seconds", options.seconds, "That slow and silent ones and followers stay")->capture_default_str();
  app.add_option("--patience", options.patience, "Seconds in which the page has to come")->capture_default_str();
  app.add_flag("--sanitized", options.limits.sanitized, "The program is built with a sanitizer: memory is not judged");
  CLI11_PARSE(app, argc, argv);
  if (options.limits.sanitized) options.limits.address_bytes = 0;
  options.program = std::filesystem::absolute(options.program);
  options.folder = std::filesystem::absolute(options.folder);
  try {
    const std::vector<ServerRow> rows = run_server_campaign(options);
    std::size_t violations = 0;
    fmt::print("{}\n", table_of(rows));
    for (const ServerRow& row : rows) {
      violations += row.violations.size();
      for (const std::string& violation : row.violations) fmt::print("violation: {}\n", violation);
    }
    fmt::print("{} violations\n", violations);
    return violations > 0 ? 1 : 0;
  } catch (const cnerf::Error& error) {
    fmt::print(stderr, "cnerf-server-campaign: {}\n", error.what());
    return int(error.exit_code());
  }
}
