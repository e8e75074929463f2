#pragma once
/// Preparing as a step of a run, or alone.

#include <filesystem>
#include <string>

#include "src/engine/engines.h"
#include "src/pipeline/run_context.h"
#include "src/prepare/motion_masks.h"
#include "src/prepare/prepare.h"

namespace cnerf::pipeline {

struct PrepareStepOptions {
  prepare::PrepareOptions capture;  ///< how it is made
  bool motion_masks = false;        ///< find what moves, by a quick fit, and mask it
  prepare::MotionMaskOptions motion;

  template <typename Visitor>
  void visit(Visitor&& v) {
    capture.visit(v);
    v("motion_masks", motion_masks, "find what moves by a quick fit of the scene, and leave it out");
    motion.visit(v);
  }
};

struct PrepareJob {
  std::filesystem::path source;  ///< photographs or a clip
  std::filesystem::path out;     ///< folder of the capture
  PrepareStepOptions options;
  ExistingOutput existing;
};

/// Whether the folder holds what was made, or begun, of another source.
[[nodiscard]] bool was_begun_for_another(const PrepareJob& job);

/// Makes a capture, unless it is there and `existing.resume` is set, and says what it wrote.
/// @throws UsageError  when there is a capture, or anything else, and neither choice is made; when both are; when
///                     `existing.resume` is set and the folder was begun for another source, or finished with another
///                     transfer; when an input lies in what `existing.overwrite` clears; and as `check_options` and
///                     `prepare_capture`.
void prepare_step(const PrepareJob& job, const Engines& engines, Observer& observer);

/// What a run works on: `source` itself if it is a capture; else the capture that is made of it beside the run's
/// folder, or was made by an earlier call. That one is sRGB-encoded.
/// @param transfer  of the source's grey values  @throws  as `prepare_step`.
[[nodiscard]] std::filesystem::path capture_of(const std::filesystem::path& source, const std::filesystem::path& run,
                                               const std::string& transfer, Observer& observer);

}  // namespace cnerf::pipeline
