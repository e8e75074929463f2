/// cnerf doctor: what this machine and build can do, and what is missing.

#include <fmt/format.h>

#include "src/app/command.h"
#include "src/app/common_options.h"
#include "src/pipeline/facts.h"

namespace cnerf::app {

Work declare_doctor(CLI::App& app) {
  auto progress = std::make_shared<std::string>();
  add_progress_options(app, *progress);  // every command takes them; there is nothing but results to print
  return [progress](const auto&) {
    if (!progress->empty()) (void)progress_style(*progress, stdout);
    for (const auto& [name, value] : pipeline::facts_of_machine()) fmt::print("{:<16} {}\n", name + ":", value);
  };
}

}  // namespace cnerf::app
