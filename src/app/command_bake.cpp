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

void bake(const BakeArguments& arguments, const std::vector<std::string>& command_line) {
  const pipeline::BakeFormats formats = pipeline::parse_bake_formats(arguments.format);
  Reporter reporter = make_reporter(arguments.run.config);
  const pipeline::RunDirectory directory = pipeline::RunDirectory::open(arguments.run.run);
  const std::string take = directory.choose_take(arguments.run.take);
  const fs::path folder = arguments.out.empty() ? directory.bakes(take) : fs::path(arguments.out);
  refuse_existing(pipeline::last_file(folder, formats), arguments.overwrite);
  const pipeline::RunContext context = open_run(arguments.run, take, command_line, reporter);
  pipeline::bake_step(context, {take, folder, formats}, engines_for(context.config.device), reporter);
  if (formats.web) reporter.next("cnerf view " + pipeline::web_folder(folder).string());
  if (formats.vdb || formats.gltf) reporter.next("blender --python " + (folder / "blender_setup.py").string());
}

}  // namespace

Work declare_bake(CLI::App& app) {
  auto arguments = std::make_shared<BakeArguments>();
  add_run_folder_options(app, arguments->run);
  app.add_option("--format", arguments->format, "vdb, gltf, exr, web or several, comma-separated");
  app.add_option("-o,--out", arguments->out, "Folder to write to; RUN/bakes/TAKE if not given");
  add_short_form(app, arguments->run.config, "--resolution", "bake.resolution", "Voxels along the longest axis");
  add_short_form(app, arguments->run.config, "--aabb", "bake.aabb", "Box to bake, x0,y0,z0,x1,y1,z1 in world units");
  add_short_form(app, arguments->run.config, "--voxel-size", "bake.voxel_size", "Side of a voxel in world units");
  add_short_form(app, arguments->run.config, "--grids", "bake.grids", "one, nested or auto: see docs/export.md");
  add_short_form(app, arguments->run.config, "--budget", "bake.budget", "Memory Cycles may take for the grids, as 4G");
  add_short_form(app, arguments->run.config, "--max-memory", "bake.max_memory",
                 "Memory the bake of a volume may take, as 1G");
  const auto flag = [&](const char* option, const char* setting, const char* help) {
    app.add_flag_callback(
        option, [arguments, setting] { arguments->run.config.short_forms.push_back(std::string(setting) + "=true"); },
        help);
  };
  flag("--keep-unseen", "bake.keep_unseen", "Keep voxels that no camera sees");
  flag("--emission", "vdb.emission", "Also write a grid emission: density times color");
  flag("--normalize-density", "vdb.normalize_density", "Density from 0 to 1, for Unreal; the scale is in the metadata");
  flag("--nvdb", "vdb.nvdb", "Also the grids as NanoVDB");
  flag("--usd", "vdb.usd", "Also a .usda with the grids");
  flag("--houdini", "vdb.houdini", "Also write the colour grid under Houdini's name, Cd");
  flag("--exr-mip", "exr.mip", "EXR textures as tiles with mip-map levels");
  add_short_form(app, arguments->run.config, "--up", "vdb.up", "Axis that points up in the VDB: y, z or poses");
  add_short_form(app, arguments->run.config, "--voxel-origin", "vdb.voxel_origin",
                 "center, or corner for Blender <= 4.4");
  add_short_form(app, arguments->run.config, "--web-resolution", "web.resolution",
                 "Voxels along the longest axis of a web bundle, at most");
  add_short_form(app, arguments->run.config, "--faces", "mesh.faces", "Triangles of the mesh, about");
  add_short_form(app, arguments->run.config, "--texture-size", "mesh.texture_size", "Texels along a side");
  app.add_flag("--overwrite", arguments->overwrite, "Replace a bake that is there");
  return [arguments](const auto& command_line) { bake(*arguments, command_line); };
}

}  // namespace cnerf::app
