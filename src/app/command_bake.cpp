/// cnerf bake: a take as a volume, a mesh and textures for other programs.

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/pipeline/bake_step.h"

namespace cnerf::app {
namespace fs = std::filesystem;
namespace {

struct BakeArguments {
  RunFolderArguments run;
  std::string format = "vdb", out;
  bool overwrite = false;
};

void bake_take(const BakeArguments& arguments, const std::vector<std::string>& command_line) {
  const exporting::Formats formats = exporting::parse_formats(arguments.format);
  Reporter reporter = make_reporter(arguments.run.config);
  const pipeline::RunDirectory directory = pipeline::RunDirectory::open(arguments.run.run);
  const std::string take = directory.choose_take(arguments.run.take);
  const fs::path folder = arguments.out.empty() ? directory.bakes(take) : fs::path(arguments.out);
  for (const fs::path& file : pipeline::whole_bakes(folder, formats)) refuse_existing(file, arguments.overwrite);
  const pipeline::RunContext context = open_run(arguments.run, take, command_line, reporter);
  pipeline::bake_step(context, {take, folder, formats}, engines_for(context.config.device), reporter);
  if (formats.web) reporter.next("cnerf view " + exporting::web_folder(folder).string());
  if (formats.is_for_blender()) reporter.next("blender --python " + (folder / "blender_setup.py").string());
}

}  // namespace

Work declare_bake(CLI::App& app) {
  auto arguments = std::make_shared<BakeArguments>();
  add_run_folder_options(app, arguments->run);
  app.add_option("--format", arguments->format, "vdb, gltf, exr, web, splat or several, comma-separated [vdb]");
  app.add_option("-o,--out", arguments->out, "Folder to write to; RUN/bakes/TAKE if not given");
  add_short_form(app, arguments->run.config, "--resolution", "bake.resolution");
  add_short_form(app, arguments->run.config, "--aabb", "bake.aabb");
  add_short_form(app, arguments->run.config, "--voxel-size", "bake.voxel_size");
  add_short_form(app, arguments->run.config, "--grids", "bake.grids");
  add_short_form(app, arguments->run.config, "--budget", "bake.budget");
  add_flag_form(app, arguments->run.config, "--keep-unseen", "bake.keep_unseen");
  add_flag_form(app, arguments->run.config, "--nvdb", "vdb.nvdb");
  add_flag_form(app, arguments->run.config, "--usd", "vdb.usd");
  add_flag_form(app, arguments->run.config, "--houdini", "vdb.houdini");
  add_short_form(app, arguments->run.config, "--up", "vdb.up");
  add_short_form(app, arguments->run.config, "--voxel-origin", "vdb.voxel_origin");
  add_short_form(app, arguments->run.config, "--web-resolution", "web.resolution");
  add_short_form(app, arguments->run.config, "--faces", "mesh.faces");
  add_short_form(app, arguments->run.config, "--texture-size", "mesh.texture_size");
  app.add_flag("--overwrite", arguments->overwrite, "Replace a bake that is there");
  return [arguments](const auto& command_line) { bake_take(*arguments, command_line); };
}

}  // namespace cnerf::app
