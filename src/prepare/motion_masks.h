#pragma once
/// Motion masks: what moved between the pictures of a capture: people, cars, leaves. A field of a static scene cannot
/// show it in the views that have it, so a quick fit disagrees with them there.

#include <filesystem>
#include <vector>

#include "src/base/observer.h"
#include "src/base/options.h"
#include "src/capture/capture.h"
#include "src/engine/engines.h"

namespace cnerf::prepare {

struct MotionMaskOptions {
  int motion_steps = 800;
  int motion_side = 320;            ///< pixels of the longer side at which it is fitted and compared
  double motion_difference = 0.12;  ///< of sRGB-encoded luminance, blurred: what surely moved
  double motion_largest = 0.4;      ///< of a picture: a view that disagrees more is badly fitted, not full of motion

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("motion_steps", motion_steps, Range{50, 100000}, "steps of the quick fit that motion is told by");
  }
};

/// The moving parts of one view.
struct MotionMask {
  int width = 0, height = 0;        ///< pixels, of the pictures compared
  std::vector<std::uint8_t> valid;  ///< [H, W] 0 = moved, 255 = stayed; empty: the fit is too poor to tell
  double share = 0;                 ///< of the picture that moved
};

/// Fits a small field to the capture for a moment and compares it with every view. The threshold is raised
/// where the fit disagrees with what surely stood still, so that a poor fit finds little rather than much.
/// @param capture  its images are reduced to about `motion_side` first
/// @param work     folder for the fit's snapshot
/// @return         one for each view.  @throws Interrupted.
[[nodiscard]] std::vector<MotionMask> find_motion(const Capture& capture, const MotionMaskOptions& options,
                                                  const std::filesystem::path& work, const Engines& engines,
                                                  Observer& observer);

}  // namespace cnerf::prepare
