/// cnerf view: a bake, a web bundle or a run in the browser.

#include <thread>

#include "bake/volume/resample.h"
#include "export/bake_output.h"
#include "export/manifest.h"
#include "export/vdb_reader.h"
#include "export/web_bundle.h"
#include "src/app/command.h"
#include "src/app/common_options.h"
#include "src/base/error.h"
#include "src/pipeline/bake_step.h"
#include "viewer/server/live_session.h"
#include "viewer/server/page_folder.h"

namespace cnerf::app {
namespace fs = std::filesystem;
namespace {

struct ViewArguments {
  ConfigArguments config;
  BrowserOptions browser;
  std::string what, take;
};

bool is_bundle(const fs::path& folder) {
  return fs::exists(folder / exporting::kWebManifest);
}
bool is_bake(const fs::path& folder) {
  return fs::exists(folder / "manifest.json");
}

/// The bundle of a bake: the one beside it, made anew where there is none or it is older than the bake.
fs::path bundle_of_bake(const fs::path& bake, const Config& config, const std::vector<std::string>& command_line,
                        Reporter& reporter) {
  const fs::path folder = exporting::web_folder(bake);
  const fs::path manifest_file = bake / "manifest.json";
  if (is_bundle(folder) && fs::last_write_time(folder / exporting::kWebManifest) >= fs::last_write_time(manifest_file))
    return folder;
  const exporting::BakeManifest manifest = exporting::read_manifest(manifest_file);
  if (!manifest.volume) {
    throw InputError(manifest_file, "volume", "this bake has none; bake with --format vdb or --format web");
  }
  const bake::Volume volume = merged_volume(exporting::read_volumes(bake));
  exporting::WebScene scene{bake.filename().string(), manifest.cameras, {}, manifest.label};
  scene.label.provenance.command_line = command_line;
  write_web(volume, scene, folder, find_page(), config.web, reporter);
  reporter.say("note: the photographs are with the capture; cnerf bake RUN --format web adds them");
  return folder;
}

fs::path bake_of_run(const ViewArguments& arguments) {
  const pipeline::RunDirectory directory = pipeline::RunDirectory::open(arguments.what);
  const fs::path bake = directory.bakes(directory.choose_take(arguments.take));
  if (!is_bake(bake) && !is_bundle(exporting::web_folder(bake))) {
    throw MissingInputError(bake.string() + ": nothing is baked yet; run: cnerf bake " + arguments.what +
                            " --format web");
  }
  return bake;
}

fs::path bundle_to_show(const ViewArguments& arguments, const Config& config,
                        const std::vector<std::string>& command_line, Reporter& reporter) {
  fs::path what = arguments.what;
  if (!fs::exists(what)) throw MissingInputError(what.string() + ": no such file or folder");
  if (what.extension() == ".vdb" || what.filename() == "manifest.json" || what.filename() == exporting::kWebManifest) {
    what = what.parent_path().empty() ? fs::path(".") : what.parent_path();
  }
  if (is_bundle(what)) return what;
  if (pipeline::RunDirectory(what).exists()) what = bake_of_run(arguments);
  if (is_bake(what)) return bundle_of_bake(what, config, command_line, reporter);
  if (is_bundle(exporting::web_folder(what))) return exporting::web_folder(what);
  throw MissingInputError(what.string() +
                          ": neither a web bundle (bundle.json), a bake (manifest.json) nor a run (run.json)");
}

void view(const ViewArguments& arguments, const std::vector<std::string>& command_line) {
  check_web_server_options(arguments.browser.server);
  Reporter reporter = make_reporter(arguments.config);
  const Config config = resolve_config(arguments.config);
  const fs::path bundle = bundle_to_show(arguments, config, command_line, reporter);
  const fs::path page = find_page();
  if (page.empty() && !fs::exists(bundle / "index.html")) {
    throw MissingInputError("the viewer's page was not built: install npm, run npm ci --prefix viewer, build again");
  }
  // The program's own page first: a bundle may hold an older one.
  std::vector<fs::path> folders{bundle};
  if (!page.empty()) folders.insert(folders.begin(), page);
  WebServer server(folders, arguments.browser.server);
  server.start();
  reporter.say("view: " + server.address());
  reporter.say("Ctrl-C ends it");
  if (!arguments.browser.no_browser) open_browser(server.address());
  while (!interruption_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(50));
}

}  // namespace

Work declare_view(CLI::App& app) {
  auto arguments = std::make_shared<ViewArguments>();
  app.add_option("WHAT", arguments->what, "Folder of a bake, of a web bundle or of a run")->required();
  app.add_option("--take", arguments->take, "Of a run: name of a colorization; the last one if not given");
  add_browser_options(app, arguments->browser);
  add_short_form(app, arguments->config, "--web-resolution", "web.resolution");
  add_config_options(app, arguments->config);
  return [arguments](const auto& command_line) { view(*arguments, command_line); };
}

}  // namespace cnerf::app
