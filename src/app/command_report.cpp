/// cnerf report: many runs in one table.

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/pipeline/runs_report.h"

namespace cnerf::app {
namespace fs = std::filesystem;
namespace {

struct ReportArguments {
  std::vector<fs::path> runs;
  fs::path out;
  std::string progress = "auto";
  bool overwrite = false;
};

void report(const ReportArguments& arguments) {
  Reporter reporter(progress_style(arguments.progress, stdout));
  const fs::path out = chosen_output(arguments.out, output_beside(arguments.runs.front(), "report"), reporter);
  refuse_existing(out, arguments.overwrite);
  const int finished = pipeline::report_runs(arguments.runs, out, reporter);
  reporter.say(std::to_string(finished) + " of " + std::to_string(arguments.runs.size()) + " runs are finished");
}

}  // namespace

Work declare_report(CLI::App& app) {
  auto arguments = std::make_shared<ReportArguments>();
  app.add_option("FOLDER", arguments->runs, "Folders of runs")->required();
  app.add_option("-o,--out", arguments->out,
                 "Folder of the report, made if needed; FOLDER-report of the first one if not given");
  app.add_flag("--overwrite", arguments->overwrite, "Replace a report that is there");
  add_progress_options(app, arguments->progress);
  return [arguments](const auto&) { report(*arguments); };
}

}  // namespace cnerf::app
