/// cnerf render: pictures and videos of a take.

#include <algorithm>
#include <sstream>

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/base/error.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

struct RenderArguments {
  RunFolderArguments run;
  std::string path = "turntable", format, out;
  bool baked = false, overwrite = false;
};

/// "png,exr" as flags. Without a format a moving camera gives a video, single views give pictures.
RenderOutput output_of(const RenderArguments& arguments) {
  RenderOutput output;
  const bool is_moving = arguments.path != "held-out";
  std::istringstream list(arguments.format.empty() ? (is_moving ? "mp4" : "png") : arguments.format);
  for (std::string format; std::getline(list, format, ',');) {
    bool* flag = format == "png"   ? &output.png
                 : format == "exr" ? &output.exr
                 : format == "mp4" ? &output.mp4
                                   : nullptr;
    if (flag == nullptr) throw UsageError("--format: expected png, exr or mp4, got '" + format + "'");
    *flag = true;
  }
  output.color = arguments.baked ? ShownColor::kBaked : ShownColor::kDecoded;
  return output;
}

void render(const RenderArguments& arguments, const std::vector<std::string>& command_line) {
  Reporter reporter = make_reporter(arguments.run.config);
  RenderOutput output = output_of(arguments);
  const RunDirectory directory = RunDirectory::open(arguments.run.run);
  const std::string take = directory.choose_take(arguments.run.take);
  output.folder = arguments.out.empty() ? directory.renders(take) : fs::path(arguments.out);
  const RunContext context = open_run(arguments.run, take, command_line, reporter);
  const CameraPath path = make_path(arguments.path, context.capture, context.config.render);
  if (output.mp4) refuse_existing(output.folder / (path.name + ".mp4"), arguments.overwrite);
  if (output.png || output.exr) refuse_existing(output.folder / path.name, arguments.overwrite);
  render_step(context, take, path, output);
  reporter.next("cnerf bake " + arguments.run.run);
}

}  // namespace

Work declare_render(CLI::App& app) {
  auto arguments = std::make_shared<RenderArguments>();
  add_run_folder_options(app, arguments->run);
  app.add_option("--path", arguments->path,
                 "turntable (whichever of the next two suits), spiral, orbit, held-out, or a camera file (JSON)");
  app.add_option("--format", arguments->format, "png, exr, mp4 or several, comma-separated");
  app.add_option("-o,--out", arguments->out, "Folder to write to; RUN/renders/TAKE if not given");
  app.add_flag("--baked", arguments->baked, "Show the colours of the bake instead of the per-pixel ones");
  app.add_flag("--overwrite", arguments->overwrite, "Replace what is there");
  return [arguments](const auto& command_line) { render(*arguments, command_line); };
}

}  // namespace cnerf
