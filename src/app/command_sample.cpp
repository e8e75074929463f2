/// cnerf sample: the embedded capture.

#include "src/app/command.h"
#include "src/app/common_options.h"
#include "src/app/run_arguments.h"
#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/sample/sample_scene.h"

namespace cnerf::app {
namespace fs = std::filesystem;
namespace {

struct SampleArguments {
  std::string out, progress = "auto";
  SampleSceneOptions options;
  bool overwrite = false;
  int threads = 0;
};

void sample(SampleArguments arguments) {
  Reporter reporter(progress_style(arguments.progress, stdout));
  arguments.out = chosen_output(arguments.out, "sample", reporter).string();
  set_thread_count(arguments.threads);
  const FolderLock lock = pipeline::lock_folder(arguments.out, FolderLock::Mode::kAlone, reporter);
  refuse_existing(fs::path(arguments.out) / "transforms.json", arguments.overwrite);
  write_sample_scene(arguments.out, arguments.options, reporter.progress_sink());
  reporter.wrote("capture", arguments.out);
  reporter.next("cnerf run " + arguments.out + " -o run --preset quick");
}

}  // namespace

Work declare_sample(CLI::App& app) {
  auto arguments = std::make_shared<SampleArguments>();
  app.add_option("-o,--out", arguments->out, "Folder of the capture, made if needed; sample if not given");
  add_field_options(app, fields_of(arguments->options));
  app.add_option("--threads", arguments->threads, "Threads to use; 0 = all cores");
  app.add_flag("--overwrite", arguments->overwrite, "Replace a capture that is there");
  add_progress_options(app, arguments->progress);
  return [arguments](const auto&) { sample(*arguments); };
}

}  // namespace cnerf::app
