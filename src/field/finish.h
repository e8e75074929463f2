#pragma once
/// The last touch on a coloured scene: how much colour, turned how far, in what light. Of all its colours alike, so
/// nothing is trained for it.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "src/base/options.h"
#include "src/color/ab_bins.h"
#include "src/field/color_field.h"

namespace cnerf {

struct Finish {
  double saturation = 1, hue = 0, exposure = 0;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("saturation", saturation, Range{0, 4}, "chroma of all colours, times");
    v("hue", hue, Range{-180, 180}, "turn of all colours in Lab's ab plane, degrees");
    v("exposure", exposure, Range{-10, 10}, "light of the scene, stops; photographs in colour keep their own");
  }
  /// As a record.
  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("saturation", self.saturation);
    v("hue", self.hue);
    v("exposure", self.exposure);
  }

  [[nodiscard]] bool is_plain() const { return saturation == 1 && hue == 0 && exposure == 0; }
  /// Of linear light.
  [[nodiscard]] float gain() const { return float(std::exp2(exposure)); }

  /// What it does to a and b, for many of them.
  struct Turn {
    float cosine, sine;  ///< times the saturation
    [[nodiscard]] Ab of(Ab color) const {
      return {cosine * color.a - sine * color.b, sine * color.a + cosine * color.b};
    }
  };
  [[nodiscard]] Turn turn() const {
    const double angle = hue * std::numbers::pi / 180;
    return {float(saturation * std::cos(angle)), float(saturation * std::sin(angle))};
  }
  [[nodiscard]] Ab of(Ab color) const { return turn().of(color); }
  /// The same without a luminance: above Lab's linear part a and b are cbrt(Y) times what the chromaticity says, so
  /// scaling and turning them is the same at every luminance.
  [[nodiscard]] Chromaticity of(Chromaticity color) const {
    const Ab unit = of(Ab{500 * (std::cbrt(color.x) - 1), 200 * (1 - std::cbrt(color.z))});
    const float x = std::max(1 + unit.a / 500, 0.0f), z = std::max(1 - unit.b / 200, 0.0f);
    return {x * x * x, z * z * z};
  }
};

}  // namespace cnerf
