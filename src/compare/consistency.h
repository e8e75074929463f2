#pragma once
/// Cross-view consistency: a pixel's colour carried to another view through depth must be found there. What flickers
/// when a camera moves has a large distance. (The idea of warping and comparing is Lai et al. 2018's, who warp by
/// optical flow; here the geometry is known.)

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "src/base/record.h"
#include "src/capture/camera.h"
#include "src/train/scene.h"

namespace cnerf::compare {

/// A rendered view and its camera.
struct SeenView {
  const RenderedImage* image = nullptr;  ///< with rgb, depth and opacity
  Intrinsics intrinsics;
  Affined world_from_camera;
};

/// Lab ab distances of carried pixels.
struct Consistency {
  double mean = 0, p95 = 0;  ///< ab units
  std::size_t pixels = 0;    ///< carried and found visible
  double chroma = 0;         ///< mean chroma of these pixels: of two methods, the greyer one has the smaller distances

  /// Percent of the chroma: 0 = consistent, 141 = two colours of random hue; nothing for a grey picture.
  [[nodiscard]] std::optional<double> relative() const {
    return pixels > 0 && chroma > 0.1 ? std::optional(100 * mean / chroma) : std::nullopt;
  }

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("pixels", self.pixels);
    v("mean", self.mean, kOptional);
    v("p95", self.p95, kOptional);
    v("chroma", self.chroma, kOptional);
  }
};

/// Two points are the same surface when their depths differ by no more than this share.
inline constexpr double kSameDepth = 0.02;

/// A pixel that was carried to where another view shows the same surface.
struct CarriedPixel {
  float distance = 0;  ///< of the two ab colours
  float chroma = 0;    ///< of the carried one
};

/// ab distances of the pixels of `from` that `to` sees as well: each solid pixel (opacity of at least 0.9) becomes a
/// point in the world by its depth, is projected into `to`, and counts where the depth there is the point's. The colour
/// there is bilinear in ab; all four pixels around must be on the surface, so that edges do not count as flicker.
[[nodiscard]] std::vector<CarriedPixel> carried_pixels(const SeenView& from, const SeenView& to);

/// Over all pairs (i, i + step) of a sequence, both ways.
[[nodiscard]] Consistency consistency(std::span<const SeenView> sequence, std::size_t step);

}  // namespace cnerf::compare
