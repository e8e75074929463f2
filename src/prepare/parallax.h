#pragma once
/// Survey of parallax among photographs: whether they can tell depth at all, before hours are spent on finding poses.

#include <filesystem>
#include <vector>

#include "src/prepare/photographs.h"

namespace cnerf::prepare {

/// What pairs of photographs tell about how the camera moved between them.
struct ParallaxSurvey {
  int judged = 0;         ///< pairs that show the same places, far enough apart to tell
  int with_parallax = 0;  ///< of them, not explained by a turn on the spot

  /// True if the camera only turned or zoomed, as far as enough pairs tell.
  [[nodiscard]] bool only_turned() const;
};

/// Matches some pairs of photographs, neighbours by name and wider ones, and judges the motion between them.
/// @param images  below `capture/images`.  @throws Interrupted.
[[nodiscard]] ParallaxSurvey survey_parallax(const std::vector<PreparedImage>& images,
                                             const std::filesystem::path& capture);

}  // namespace cnerf::prepare
