#include "src/pipeline/shown_bundle.h"

#include "export/bake_output.h"
#include "export/manifest.h"
#include "export/vdb_reader.h"
#include "export/web_bundle.h"
#include "src/base/absolute_folder.h"
#include "src/base/error.h"
#include "src/base/json.h"
#include "src/capture/exr_io.h"
#include "src/pipeline/run_context.h"
#include "viewer/server/page_folder.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

bool is_bundle(const fs::path& folder) {
  return fs::exists(folder / exporting::kWebManifest);
}
bool is_bake(const fs::path& folder) {
  return fs::exists(folder / "manifest.json");
}

std::optional<SkyPicture> sky_of(const exporting::BakeManifest& manifest, const fs::path& bake) {
  if (!manifest.sky) return std::nullopt;
  exporting::check_listed_file(manifest, bake, manifest.sky->file);
  const LinearImage image = read_exr(bake / manifest.sky->file);
  if (image.channels != 3) throw InputError(bake / manifest.sky->file, "channels", "expected R, G and B");
  return SkyPicture{image.width, image.height, image.values};
}

/// Made with it, by one command, or later.
bool is_of_bake(const fs::path& bundle, const exporting::BakeManifest& manifest, const fs::path& manifest_file) {
  if (fs::last_write_time(bundle) >= fs::last_write_time(manifest_file)) return true;
  try {
    return read_json(bundle).at("command_line") == manifest.label.provenance.command_line;
  } catch (const std::exception&) {
    return false;  // it is damaged, and made anew
  }
}

/// The bundle of a bake: the one beside it, made anew where there is none or it is older than the bake.
fs::path bundle_of_bake(const fs::path& bake, const ShowJob& job, const exporting::WebOptions& options,
                        Observer& observer) {
  const fs::path folder = exporting::web_folder(bake);
  const fs::path manifest_file = bake / "manifest.json";
  const exporting::BakeManifest manifest = exporting::read_manifest(manifest_file);
  if (is_bundle(folder) && is_of_bake(folder / exporting::kWebManifest, manifest, manifest_file)) return folder;
  const FolderLock lock = lock_folder(bake, FolderLock::Mode::kAlone, observer);
  if (!manifest.volume) {
    throw InputError(manifest_file, "volume", "this bake has none; bake with --format vdb or --format web");
  }
  const std::string title = absolute_folder(bake).filename().string();
  exporting::WebScene scene{title, manifest.cameras, {}, manifest.label, sky_of(manifest, bake)};
  scene.label.provenance.command_line = job.command_line;
  write_web(exporting::read_volumes(bake), scene, folder, web::find_page(), options, observer);
  observer.say("note: the photographs are with the capture; cnerf bake RUN --format web adds them");
  return folder;
}

fs::path bake_of_run(const fs::path& run, const std::string& take) {
  const RunDirectory directory = RunDirectory::open(run);
  const fs::path bake = directory.bakes(directory.choose_take(take));
  if (!is_bake(bake) && !is_bundle(exporting::web_folder(bake))) {
    throw MissingInputError(bake.string() + ": nothing is baked yet; run: cnerf bake " + run.string() +
                            " --format web");
  }
  return bake;
}

}  // namespace

fs::path bundle_to_show(const ShowJob& job, const exporting::WebOptions& options, Observer& observer) {
  fs::path what = job.what;
  if (!fs::exists(what)) throw MissingInputError(what.string() + ": no such file or folder");
  if (what.extension() == ".vdb" || what.filename() == "manifest.json" || what.filename() == exporting::kWebManifest) {
    what = what.parent_path().empty() ? fs::path(".") : what.parent_path();
  }
  if (!job.take.empty() && !RunDirectory(what).exists()) {
    throw UsageError("--take: is for a run; " + job.what.string() + " is none");
  }
  if (is_bundle(what)) return what;
  if (RunDirectory(what).exists()) what = bake_of_run(job.what, job.take);
  if (is_bake(what)) return bundle_of_bake(what, job, options, observer);
  if (is_bundle(exporting::web_folder(what))) return exporting::web_folder(what);
  throw MissingInputError(what.string() +
                          ": neither a web bundle (bundle.json), a bake (manifest.json) nor a run (run.json)");
}

}  // namespace cnerf::pipeline
