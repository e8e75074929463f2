#pragma once
/// The steps of a run, each usable alone: what `cnerf run` does one after another and the other commands one by one.
/// Every step says what it wrote.

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

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

/// The colorizer the configuration names. What it learns is kept in the run's folder, for the next time.
/// @throws UsageError, MissingInputError, ColorizerError.
[[nodiscard]] std::unique_ptr<Colorizer> colorizer_of(const RunContext& context);

/// Stage 1, unless it is finished.
void train_step(RunContext& context, bool resume);

/// The take a colorization goes to: the named one, else a free name after the colorizer's kind; with `resume` the take
/// that was not finished.  @throws UsageError  when the named take is finished and neither is set.
[[nodiscard]] std::string take_to_write(const RunContext& context, const std::string& named,
                                        const ExistingOutput& existing);
/// Stage 2 into `take`, unless it is finished. Makes it the current take.
/// @param colorizer  null: `colorizer_of(context)` is made when it is needed.
void colorize_step(RunContext& context, const std::string& take, const ExistingOutput& existing,
                   std::unique_ptr<Colorizer> colorizer = nullptr);

/// Measures a take (empty: luminance only) and writes metrics.json and the contact sheet.
void evaluate_step(const RunContext& context, const std::string& take);

/// What a bake writes.
struct BakeFormats {
  bool vdb = false;   ///< the volume
  bool gltf = false;  ///< a textured mesh, as .gltf and .glb
  bool exr = false;   ///< the mesh's textures in floating point, beside the mesh
};
/// "vdb,gltf,exr" or some of them; exr brings the mesh along.  @throws UsageError.
[[nodiscard]] BakeFormats parse_bake_formats(const std::string& list);

/// Bakes a take (empty: grey) and writes the set-up script and the manifest beside it.
void bake_step(const RunContext& context, const std::string& take, const std::filesystem::path& folder,
               const BakeFormats& formats);

/// File kinds a render leaves.
struct RenderOutput {
  std::filesystem::path folder;
  bool png = false, exr = false, mp4 = false;
  ShownColor color = ShownColor::kDecoded;
};
/// Renders a take along a path.
void render_step(const RunContext& context, const std::string& take, const CameraPath& path,
                 const RenderOutput& output);

[[nodiscard]] RenderOptions render_options(const Config& config);

}  // namespace cnerf
