/// cnerf prepare: photographs or a film clip in, a capture out.

#include "src/app/command.h"
#include "src/app/common_options.h"
#include "src/base/parallel.h"
#include "src/pipeline/prepare_step.h"

namespace cnerf::app {
namespace {

struct PrepareArguments {
  std::string progress = "auto";
  pipeline::PrepareJob job;
  int threads = 0;
};

void prepare(const PrepareArguments& arguments) {
  Reporter reporter(progress_style(arguments.progress, stdout));
  set_thread_count(arguments.threads);
  pipeline::prepare_step(arguments.job, engines_for("auto"), reporter);
  reporter.next("cnerf run " + arguments.job.out.string() + " -o run --preset quick");
}

}  // namespace

Work declare_prepare(CLI::App& app) {
  auto arguments = std::make_shared<PrepareArguments>();
  app.add_option("SOURCE", arguments->job.source, "Folder of photographs, or a film clip")->required();
  app.add_option("-o,--out", arguments->job.out, "Folder of the capture, made if needed")->required();
  add_field_options(app, fields_of(arguments->job.options));
  app.add_option("--threads", arguments->threads, "Threads to use; 0 = all cores");
  app.add_flag("--resume", arguments->job.existing.resume, "Go on with a capture that was stopped");
  app.add_flag("--overwrite", arguments->job.existing.overwrite, "Replace a capture that is there");
  app.add_option("--progress", arguments->progress, "auto, line, plain, json or quiet");
  return [arguments](const auto&) { prepare(*arguments); };
}

}  // namespace cnerf::app
