/// cnerf prepare: photographs or a film clip in, a capture out.

#include "src/app/command.h"
#include "src/app/common_options.h"
#include "src/app/prepare_step.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

struct PrepareArguments {
  std::string source, out, progress = "auto";
  PrepareStepOptions options;
  ExistingOutput existing;
  int threads = 0;
};

void prepare(const PrepareArguments& arguments) {
  Reporter reporter(progress_style(arguments.progress, stdout));
  set_thread_count(arguments.threads);
  prepare_step(arguments.source, arguments.out, arguments.options, arguments.existing, engines_for("auto"), reporter);
  reporter.next("cnerf run " + arguments.out + " -o run --preset quick");
}

}  // namespace

Work declare_prepare(CLI::App& app) {
  auto arguments = std::make_shared<PrepareArguments>();
  app.add_option("SOURCE", arguments->source, "Folder of photographs, or a film clip")->required();
  app.add_option("-o,--out", arguments->out, "Folder of the capture, made if needed")->required();
  add_field_options(app, fields_of(arguments->options));
  app.add_option("--threads", arguments->threads, "Threads to use; 0 = all cores");
  app.add_flag("--resume", arguments->existing.resume, "Go on with a capture that was stopped");
  app.add_flag("--overwrite", arguments->existing.overwrite, "Replace a capture that is there");
  app.add_option("--progress", arguments->progress, "auto, line, plain, json or quiet");
  return [arguments](const auto&) { prepare(*arguments); };
}

}  // namespace cnerf
