#pragma once
/// The colours of the sky of a take: what the colorizer's answers and known colours say of directions in which nothing
/// is in the way.

#include <span>
#include <vector>

#include "src/color/ab_bins.h"
#include "src/field/finish.h"
#include "src/render/direction_map.h"
#include "src/train/chroma/known_color_map.h"
#include "src/train/luminance/view_cache.h"

namespace cnerf {

/// What light from two places is together.
[[nodiscard]] Ab mixed(Ab one, float light_of_one, Ab other, float light_of_other);

class SkyColors {
 public:
  /// None: the scene has no sky.
  SkyColors() = default;
  explicit SkyColors(int width) : sums_(width, 2) { refresh(); }
  /// Grey, of the usual size.
  static SkyColors grey() { return SkyColors(128); }

  [[nodiscard]] bool exists() const { return sums_.width() > 0; }
  [[nodiscard]] int width() const { return sums_.width(); }
  [[nodiscard]] bool is_grey() const { return sums_.is_empty(); }
  /// Adds what is said of a pixel's colour; what the field covers of it counts less, and most of it not at all.
  void add(const CachedView& view, std::size_t pixel, Ab color, float weight = 1);
  /// The same of all known pixels, which overrule answers.
  void add(std::span<const CachedView> views, const KnownColorMap& known);
  /// Makes colours of what was added. Where nothing was, they go on smoothly.
  void refresh();

  [[nodiscard]] Ab along(Vec3f direction) const;
  /// The colour of a pixel whose field has that colour: with the sky behind it.
  [[nodiscard]] Ab behind(const CachedView& view, std::size_t pixel, float field_luminance, Ab color) const;
  /// What was added, for snapshots; `refresh` after writing.
  [[nodiscard]] std::vector<float>& sums() { return sums_.sums(); }

 private:
  DirectionSums sums_;
  DirectionMap colors_;
};

/// Light and colours of the sky together.
struct ColoredSky {
  DirectionView light = {};           ///< linear Y; without values there is no sky
  const SkyColors* colors = nullptr;  ///< null: grey
  Finish finish = {};

  [[nodiscard]] bool exists() const { return light.values != nullptr; }
  /// Linear Rec.709.
  [[nodiscard]] Vec3f along(Vec3f direction) const;
};

}  // namespace cnerf
