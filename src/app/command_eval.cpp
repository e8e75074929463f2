/// cnerf eval: numbers and a contact sheet of a take.

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/pipeline/evaluate_step.h"

namespace cnerf::app {
namespace {

struct EvalArguments : RunFolderArguments {
  std::string lpips_weights;
  bool aligned = false;
};

void eval(const EvalArguments& arguments, const std::vector<std::string>& command_line) {
  Reporter reporter = make_reporter(arguments.config);
  const std::string take = pipeline::RunDirectory::open(arguments.run).choose_take(arguments.take);
  const pipeline::RunContext context = open_run(arguments, take, command_line, reporter);
  pipeline::evaluate_step(context, {take, arguments.lpips_weights, arguments.aligned},
                          engines_for(context.config.device), reporter);
  reporter.next("cnerf render " + arguments.run + " --path turntable");
}

}  // namespace

Work declare_eval(CLI::App& app) {
  auto arguments = std::make_shared<EvalArguments>();
  add_run_folder_options(app, *arguments);
  app.add_option("--lpips-weights", arguments->lpips_weights,
                 "Also measure LPIPS, with these weights (X_f32.bin beside X_manifest.txt)");
  app.add_flag("--aligned", arguments->aligned,
               "Also fit the pose of each held-out view on its left half and judge the right half; always where poses "
               "or lenses were learned");
  return [arguments](const auto& command_line) { eval(*arguments, command_line); };
}

}  // namespace cnerf::app
