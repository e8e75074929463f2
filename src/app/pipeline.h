#pragma once
/// The steps of a run, each usable alone: what `cnerf run` does one after another and the other commands one by one.
/// Every step says what it wrote.

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "export/web_bundle.h"
#include "src/app/camera_path.h"
#include "src/app/picture_files.h"
#include "src/app/reporter.h"
#include "src/app/run_directory.h"
#include "src/capture/capture.h"
#include "src/colorizer/colorizer.h"
#include "src/config/config.h"

namespace cnerf {

/// What a step works on.
struct RunContext {
  RunDirectory directory;
  Config config;
  Capture capture;
  std::vector<std::string> command_line;
  Reporter& reporter;
  const Engines& engines;
  Observer* watcher = nullptr;  ///< of the training, instead of the reporter

  /// Who is told how the training goes.
  [[nodiscard]] Observer& training_observer() const { return watcher != nullptr ? *watcher : reporter; }
};

/// What to do about output that is already there.
struct ExistingOutput {
  bool resume = false;     ///< go on where it stopped; what is finished stays
  bool overwrite = false;  ///< start again
};

/// Reads a capture and says what was found, with the reader's notes.
[[nodiscard]] Capture read_capture(const std::filesystem::path& path, const Config& config, Reporter& reporter);

/// Whether a run may go to the folder; nothing is changed yet.
/// @throws UsageError  when there is a run and neither is set, or the folder holds something else.
void check_run_folder(const RunDirectory& directory, const ExistingOutput& existing);
/// Makes the folder of a run ready: clears it to overwrite, writes config.toml and run.json.
void begin_run(const RunContext& context, const std::filesystem::path& capture_path, const ExistingOutput& existing);

/// What the configuration says of its colorizer. The folders are those of `ColorizerOptions`; empty = none.
[[nodiscard]] ColorizerOptions colorizer_options(const Config& config, const std::filesystem::path& working_folder,
                                                 const std::filesystem::path& cache_folder, Reporter& reporter);
/// The colorizer the configuration names. What it learns is kept in the run's folder, for the next time.
/// @throws UsageError, MissingInputError, ColorizerError.
[[nodiscard]] std::unique_ptr<Colorizer> colorizer_of(const RunContext& context);

/// Stage 1, unless it is finished.
void train_step(RunContext& context, bool resume);

/// The take a colorization goes to: the named one, else a free name after the colorizer's kind; with `resume` the take
/// that was not finished.  @throws UsageError  when the named take is finished and neither is set.
[[nodiscard]] std::string take_to_write(const RunContext& context, const std::string& named,
                                        const ExistingOutput& existing);
/// Writes the gallery of base candidates beside the takes; touches none of them.
void show_bases(const RunContext& context);
/// Stage 2 into `take`, unless it is finished. Makes it the current take.
/// @param colorizer  null: `colorizer_of(context)` is made when it is needed.
void colorize_step(RunContext& context, const std::string& take, const ExistingOutput& existing,
                   std::unique_ptr<Colorizer> colorizer = nullptr);

/// Measures a take (empty: luminance only) and writes metrics.json and the contact sheet.
/// @param lpips_weights  see `Lpips`; empty = LPIPS is not measured
void evaluate_step(const RunContext& context, const std::string& take, const std::filesystem::path& lpips_weights = {});

/// What a bake writes.
struct BakeFormats {
  bool vdb = false;   ///< the volume
  bool gltf = false;  ///< a textured mesh, as .gltf and .glb
  bool exr = false;   ///< the mesh's textures in floating point, beside the mesh
  bool web = false;   ///< a folder with a page, for browsers
};
/// "vdb,gltf,exr,web" or some of them; exr brings the mesh along.  @throws UsageError.
[[nodiscard]] BakeFormats parse_bake_formats(const std::string& list);

/// The file that a bake of these formats writes last: once it is there, all of it is.
[[nodiscard]] std::filesystem::path last_file(const std::filesystem::path& folder, const BakeFormats& formats);
/// The folder of the web bundle of a bake.
[[nodiscard]] std::filesystem::path web_folder(const std::filesystem::path& bake);

/// Bakes a take (empty: grey) and writes the set-up script and the manifest beside it.
void bake_step(const RunContext& context, const std::string& take, const std::filesystem::path& folder,
               const BakeFormats& formats);

/// Writes the web bundle of a volume; says its size before and after.
void write_web(const BakedVolume& volume, WebScene scene, const std::filesystem::path& folder,
               const WebOptions& options, Reporter& reporter);

/// File kinds a render leaves.
struct RenderOutput {
  std::filesystem::path folder;
  bool png = false, exr = false, mp4 = false;
  ShownColor color = ShownColor::kDecoded;
  bool view_averaged = false;  ///< luminance as a bake averages it over the views that see a point
};
/// Renders a take along a path.
void render_step(const RunContext& context, const std::string& take, const CameraPath& path,
                 const RenderOutput& output);

[[nodiscard]] RenderOptions render_options(const Config& config);

}  // namespace cnerf
