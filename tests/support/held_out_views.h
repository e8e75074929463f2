#pragma once
/// How well an engine shows the views it was not trained on.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "src/engine/luminance_engine.h"
#include "src/evaluate/pose_alignment.h"
#include "src/field/scene_frame.h"

namespace cnerf::test {

struct HeldOutView {
  std::string name;
  double as_given = 0;         ///< dB of sRGB-encoded luminance, at the exposure that training views let expect
  double exposure_fitted = 0;  ///< the same, after a gain of linear light by least squares
  double aligned = 0;          ///< of the right half, pose and gain fitted on the left half, the field held
  double near_opacity = 0;     ///< mean opacity of the first tenth of rays' ways through the field's box
};

/// dB of sRGB-encoded luminance.  @param gain  of linear light, on what was seen
[[nodiscard]] double psnr_of(const std::vector<RayResult>& seen, const MonoImage& image, double gain = 1);

/// What views are judged with.
struct Judge {
  const Capture& capture;
  const SceneFrame& frame;
  const LuminanceEngine& engine;
  MarchSettings march;
  RenderEffort effort;
  std::filesystem::path pictures = {};          ///< a folder for what was seen beside what was to be seen, PGM
  std::optional<PoseAlignment> alignment = {};  ///< from the file's poses to those learned; none: not aligned

  /// All held-out views.
  [[nodiscard]] std::vector<HeldOutView> judge() const;

 private:
  [[nodiscard]] HeldOutView judge(const View& view, float log_gain) const;
};

/// From true poses of the training views to those that the judge's engine learned; prints how far they are apart,
/// before and after.
PoseAlignment print_alignment(const Judge& judge, const std::vector<Affined>& truth);

/// A line per view, and one for their mean and the worst.
void print_held_out(const std::vector<HeldOutView>& views);

}  // namespace cnerf::test
