#pragma once
/// A scene that renders one colour.

#include "src/train/scene.h"

namespace cnerf::test {

/// Renders one picture, whatever the camera; with `colour`, red of the picture's luminance.
class PaintedScene : public Scene {
 public:
  PaintedScene(float luminance, bool colour) : luminance_(luminance), colour_(colour) {}
  const SceneFrame& frame() const override { return frame_; }
  bool may_be_occupied(Vec3f) const override { return true; }
  void query_density(std::span<const Vec3f>, std::span<float>) const override {}
  void query_luminance(std::span<const Vec3f>, std::span<const Vec3f>, std::span<float>) const override {}
  void query_chromaticity(std::span<const Vec3f>, std::span<Chromaticity>) const override {}
  bool is_colorized() const override { return colour_; }
  std::string colorizer() const override { return colour_ ? "painted" : ""; }
  RenderedImage render(const Intrinsics& intrinsics, const Affined&, const RenderOptions& options) const override {
    RenderedImage image{intrinsics.width, intrinsics.height, {}, {}, {}, {}, {}};
    const std::size_t n = std::size_t(image.width) * image.height;
    image.luminance.assign(n, luminance_);
    image.opacity.assign(n, 1.0f);
    image.depth.assign(n, 1.0f);
    if (options.color) image.rgb = repeated({luminance_ / 0.2126729f, 0, 0}, n);
    if (options.baked_color) image.baked_rgb = repeated({luminance_, luminance_, luminance_}, n);
    return image;
  }

 private:
  static std::vector<float> repeated(Vec3f rgb, std::size_t n) {
    std::vector<float> values;
    for (std::size_t i = 0; i < n; ++i) values.insert(values.end(), {rgb.x, rgb.y, rgb.z});
    return values;
  }
  SceneFrame frame_;
  float luminance_;
  bool colour_;
};

}  // namespace cnerf::test
