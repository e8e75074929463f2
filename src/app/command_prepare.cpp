/// cnerf prepare: photographs or a film clip in, a capture out.

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/base/parallel.h"
#include "src/pipeline/prepare_step.h"

namespace cnerf::app {
namespace {

struct PrepareArguments {
  std::string progress = "auto";
  pipeline::PrepareJob job;
  int threads = 0;
};

void prepare(PrepareArguments arguments) {
  Reporter reporter(progress_style(arguments.progress, stdout));
  pipeline::PrepareJob& job = arguments.job;
  job.out = chosen_output(job.out, output_beside(job.source, "capture"), reporter);
  set_thread_count(arguments.threads);
  pipeline::prepare_step(job, engines_for("auto"), reporter);
  reporter.next("cnerf run " + job.out.string() + " -o run --preset quick");
}

}  // namespace

Work declare_prepare(CLI::App& app) {
  auto arguments = std::make_shared<PrepareArguments>();
  app.add_option("SOURCE", arguments->job.source, "Folder of photographs, or a film clip")->required();
  app.add_option("-o,--out", arguments->job.out, "Folder of the capture, made if needed; SOURCE-capture if not given");
  add_field_options(app, fields_of(arguments->job.options));
  app.add_option("--threads", arguments->threads, "Threads to use; 0 = all cores");
  app.add_flag("--resume", arguments->job.existing.resume, "Go on with a capture that was stopped");
  app.add_flag("--overwrite", arguments->job.existing.overwrite, "Replace a capture that is there");
  add_progress_options(app, arguments->progress);
  return [arguments](const auto&) { prepare(*arguments); };
}

}  // namespace cnerf::app
