#pragma once
/// How well an engine shows the views it was not trained on.

#include <filesystem>
#include <string>
#include <vector>

#include "src/engine/luminance_engine.h"
#include "src/field/scene_frame.h"

namespace cnerf::test {

struct HeldOutView {
  std::string name;
  double as_given = 0;         ///< dB of sRGB-encoded luminance
  double exposure_fitted = 0;  ///< the same, after a gain of linear light by least squares
  double near_opacity = 0;     ///< mean opacity of the first tenth of rays' ways through the field's box
};

/// dB of sRGB-encoded luminance.  @param gain  of linear light, on what was seen
[[nodiscard]] double psnr_of(const std::vector<RayResult>& seen, const MonoImage& image, double gain = 1);

/// Renders all held-out views.
/// @param pictures  a folder for what was seen beside what was to be seen, PGM; empty: none
[[nodiscard]] std::vector<HeldOutView> judge_held_out(const Capture& capture, const SceneFrame& frame,
                                                      const LuminanceEngine& engine, const MarchSettings& march,
                                                      const RenderEffort& effort,
                                                      const std::filesystem::path& pictures = {});

/// A line per view, and one for their mean and the worst.
void print_held_out(const std::vector<HeldOutView>& views);

}  // namespace cnerf::test
