#pragma once
/// Preparing as a step of a run, or alone.

#include <filesystem>

#include "src/app/pipeline.h"
#include "src/prepare/prepare.h"
#include "src/train/motion_masks.h"

namespace cnerf {

struct PrepareStepOptions {
  PrepareOptions prepare;
  bool motion_masks = false;  ///< find what moves, by a quick fit, and mask it
  MotionMaskOptions motion;

  template <typename Visitor>
  void visit(Visitor&& v) {
    prepare.visit(v);
    v("motion_masks", motion_masks, "find what moves by a quick fit of the scene, and leave it out");
    motion.visit(v);
  }
};

/// Makes a capture in `out`, unless it is there and `existing.resume` is set, and says what it wrote.
/// @throws UsageError  when there is a capture, or anything else, and neither choice is made; when `existing.resume` is
///                     set and the folder was begun for another source; and as `prepare_capture`.
void prepare_step(const std::filesystem::path& source, const std::filesystem::path& out,
                  const PrepareStepOptions& options, const ExistingOutput& existing, const Engines& engines,
                  Reporter& reporter);

/// What a run works on: `source` itself if it is a capture; else the capture that is made of it beside the run's
/// folder, or was made by an earlier call.  @throws  as `prepare_step`.
[[nodiscard]] std::filesystem::path capture_of(const std::filesystem::path& source, const std::filesystem::path& run,
                                               Reporter& reporter);

}  // namespace cnerf
