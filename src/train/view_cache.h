#pragma once
/// Frozen geometry, cached: what each training view sees at a working resolution, and the few samples behind each
/// pixel.

#include <cstdint>
#include <span>
#include <vector>

#include "src/engine/color_engines.h"
#include "src/engine/luminance_engine.h"
#include "src/render/training_views.h"

namespace cnerf {

/// A sample in 8 bytes: captures of millions of pixels have hundreds of millions of them.
struct CachedSample {
  float t = 0;                  ///< unit space
  std::uint16_t weight = 0;     ///< of 65535
  std::uint16_t luminance = 0;  ///< of 65535, times the view's `brightest`
};

/// One view at working resolution. Arrays are [H, W].
struct CachedView {
  UnitCamera camera;
  int width = 0, height = 0;
  std::vector<float> luminance;  ///< linear Y over black
  std::vector<float> opacity;
  float brightest = 1;                ///< luminance of the brightest sample
  std::vector<CachedSample> samples;  ///< pixel by pixel, front to back
  std::vector<std::size_t> offsets;   ///< [H W + 1]

  [[nodiscard]] int short_side() const { return std::min(width, height); }
};

/// Renders a view with its short side at most `short_side` pixels. Of each pixel the heaviest samples are kept that
/// carry `share` of its weight.
[[nodiscard]] CachedView cache_view(const LuminanceEngine& engine, const MarchSettings& march,
                                    const UnitCamera& full_size_camera, int short_side, double share);

/// Makes pixels transparent that the view's mask says to ignore, wholly or in part: nothing there is learnt from, and
/// no histogram counts it. What a colorizer is shown stays.
void ignore_masked(CachedView& view, const MonoImage& image);

/// Traced samples as the chroma engines want them.
[[nodiscard]] PixelSamples pixel_samples(std::span<const Ray> rays, std::span<const WeightedSample> samples,
                                         std::span<const std::size_t> offsets);

/// A pixel of one of several views.
struct ViewPixel {
  std::uint32_t view = 0;
  std::uint32_t pixel = 0;  ///< y * width + x
};
/// Samples of some pixels of cached views.
[[nodiscard]] PixelSamples pixel_samples(std::span<const CachedView> views, std::span<const ViewPixel> pixels);

}  // namespace cnerf
