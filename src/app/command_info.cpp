/// cnerf info: what a thing is.

#include <fmt/format.h>

#include "src/app/command.h"
#include "src/app/common_options.h"
#include "src/pipeline/facts.h"

namespace cnerf::app {
namespace {

struct InfoArguments {
  ConfigArguments config;
  std::string what;
};

void info(const InfoArguments& arguments) {
  const Config config = resolve_config(arguments.config);
  for (const auto& [name, value] : pipeline::facts_of(arguments.what, config.capture)) {
    fmt::print("{:<18} {}\n", name + ":", value);
  }
}

}  // namespace

Work declare_info(CLI::App& app) {
  auto arguments = std::make_shared<InfoArguments>();
  app.add_option("WHAT", arguments->what,
                 "A capture, a folder of photographs, a film clip, a run, a .snapshot or a .vdb")
      ->required();
  add_short_form(app, arguments->config, "--downscale", "capture.downscale");
  add_short_form(app, arguments->config, "--holdout", "capture.holdout");
  add_config_options(app, arguments->config);
  return [arguments](const auto&) { info(*arguments); };
}

}  // namespace cnerf::app
