#pragma once
/// Rendering as a step of a run.

#include <filesystem>
#include <string>

#include "src/engine/engines.h"
#include "src/pipeline/picture_files.h"
#include "src/pipeline/run_context.h"
#include "src/render/camera_path.h"

namespace cnerf::pipeline {

/// File kinds that a render leaves.
struct RenderOutput {
  std::filesystem::path folder;
  bool png = false, exr = false, mp4 = false;
  ShownColor color = ShownColor::kDecoded;
  bool view_averaged = false;  ///< luminance as a bake averages it over the views that see a point
  bool overwrite = false;      ///< frames that a longer render left go
};

struct RenderJob {
  std::string take;  ///< empty = luminance only
  CameraPath path;
  RenderOutput output;
  const Scene* scene = nullptr;  ///< the take's, with the configured finish; null = the step loads it
};

/// Renders a take along a path.
/// @throws UsageError  for a video of cameras of several sizes
void render_step(const RunContext& context, const RenderJob& job, const Engines& engines, Observer& observer);

[[nodiscard]] RenderOptions render_options(const Config& config);

}  // namespace cnerf::pipeline
