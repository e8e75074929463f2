#include "src/train/scene.h"

#include <algorithm>
#include <optional>

#include "src/base/parallel.h"
#include "src/picture/picture.h"
#include "src/train/chroma/color_model.h"
#include "src/train/luminance/luminance_model.h"

namespace cnerf {

namespace {

constexpr std::size_t kGrain = 256;  // rays of a parallel piece of work

/// Colours of the pixels from `first` on, at their luminance, to an image of three interleaved channels.
void put_colors(const std::vector<Ab>& colors, const std::vector<float>& luminance, std::size_t first,
                std::vector<float>& image) {
  parallel_each(colors.size(), kGrain, [&](std::size_t i) {
    const Vec3f rgb = linear_rgb_at(luminance[first + i], colors[i]);
    for (int c = 0; c < 3; ++c) image[3 * (first + i) + std::size_t(c)] = rgb[c];
  });
}

class TrainedScene final : public Scene {
 public:
  TrainedScene(const std::filesystem::path& stage1_snapshot, const std::filesystem::path& take_snapshot,
               const Finish& finish, const Engines& engines)
      : luminance_(LuminanceModel::load(stage1_snapshot, engines)), finish_(finish) {
    if (!take_snapshot.empty()) color_ = ColorModel::load(take_snapshot, engines);
    sky_ = {luminance_.sky_light(), color_ ? &color_->sky : nullptr, finish_};
  }

  [[nodiscard]] const SceneFrame& frame() const override { return luminance_.frame; }
  [[nodiscard]] bool may_be_occupied(Vec3f position) const override {
    const OccupancyGrid& grid = luminance_.engine->occupancy();
    return grid.occupied(grid.cascade_of(position), position);
  }
  void mark_occupied(std::span<const float> x, std::span<const float> y, std::span<const float> z,
                     std::span<std::uint8_t> marks) const override {
    luminance_.engine->occupancy().mark_occupied(x, y, z, marks);
  }
  [[nodiscard]] std::size_t points_at_a_time() const override { return luminance_.engine->points_at_a_time(); }
  void query_density(std::span<const Vec3f> positions, std::span<float> sigma) const override {
    luminance_.engine->query_density(positions, sigma);
  }
  void query_luminance(std::span<const Vec3f> positions, std::span<const Vec3f> directions,
                       std::span<float> luminance) const override {
    luminance_.engine->query_luminance(positions, directions, luminance);
    for (float& light : luminance) light *= finish_.gain();
  }
  [[nodiscard]] float gain() const override { return finish_.gain(); }
  void query_chromaticity(std::span<const Vec3f> positions, std::span<Chromaticity> chromaticity) const override {
    if (color_) {
      color_->chromaticity->query(positions, chromaticity);
      if (finish_.is_plain()) return;
      for (Chromaticity& color : chromaticity) color = finish_.of(color);
    } else {
      std::fill(chromaticity.begin(), chromaticity.end(), Chromaticity{});
    }
  }

  [[nodiscard]] bool is_colorized() const override { return color_.has_value(); }
  [[nodiscard]] std::optional<SkyPicture> sky() const override {
    if (!sky_.exists()) return std::nullopt;
    const int width = luminance_.sky.width, height = luminance_.sky.height;
    SkyPicture picture{width, height, std::vector<float>(3 * std::size_t(width) * std::size_t(height))};
    parallel_tasks(std::size_t(height), [&](std::size_t y) {
      for (int x = 0; x < width; ++x) {
        const SkyPlace place{(float(x) + 0.5f) / float(width), 1 - (float(y) + 0.5f) / float(height)};
        const Vec3f rgb = sky_.along(sky_direction(place));
        for (int c = 0; c < 3; ++c)
          picture.rgb[3 * (y * std::size_t(width) + std::size_t(x)) + std::size_t(c)] = rgb[c];
      }
    });
    return picture;
  }
  [[nodiscard]] std::optional<SeenScene> seen(const RenderOptions& options) const override {
    return SeenScene{*luminance_.engine, luminance_.march(options.steps_per_box),
                     options.sky ? luminance_.sky_light() : DirectionView{}};
  }
  [[nodiscard]] std::string colorizer() const override { return color_ ? color_->colorizer : ""; }

  [[nodiscard]] RenderedImage render(const Intrinsics& intrinsics, const Affined& world_from_camera,
                                     const RenderOptions& options) const override {
    const UnitCamera camera(intrinsics, world_from_camera, luminance_.frame);
    RenderedImage image;
    image.width = intrinsics.width;
    image.height = intrinsics.height;
    const std::size_t n = std::size_t(image.width) * std::size_t(image.height);
    for (auto* channel : {&image.luminance, &image.opacity, &image.depth}) channel->resize(n);
    if (color_ && options.color) image.rgb.resize(3 * n);
    if (color_ && options.baked_color) image.baked_rgb.resize(3 * n);
    const std::size_t at_a_time = luminance_.engine->rays_at_a_time();
    for (std::size_t first = 0; first < n; first += at_a_time) {
      render_part(camera, options, first, std::min(n, first + at_a_time), image);
    }
    return image;
  }

 private:
  /// The light of pixels where it is not what was traced, before the exposure. Empty: it is.
  [[nodiscard]] std::optional<PixelSamples> relit(const TracedPixels& traced, const RenderOptions& options) const {
    if (!options.luminance) return std::nullopt;
    PixelSamples pixels = traced.samples();
    options.luminance(pixels.positions, pixels.luminance);
    for (float& light : pixels.luminance) light /= finish_.gain();
    return pixels;
  }

  void render_part(const UnitCamera& camera, const RenderOptions& options, std::size_t first, std::size_t last,
                   RenderedImage& image) const {
    std::vector<Ray> rays(last - first);
    parallel_each(rays.size(), kGrain, [&](std::size_t r) { rays[r] = camera.ray_of_pixel(first + r); });
    const auto traced =
        luminance_.engine->trace_pixels(rays, luminance_.march(options.steps_per_box), options.effort());
    const std::optional<PixelSamples> pixels = relit(*traced, options);
    const std::vector<float> light = pixels ? pixel_luminance(*pixels) : std::vector<float>();
    const Vec3f axis = camera.unit_from_camera.column(2).cast<float>();
    parallel_each(rays.size(), kGrain, [&](std::size_t r) {
      const RayResult& seen = traced->results()[r];
      image.luminance[first + r] = pixels ? light[r] : seen.luminance;
      image.opacity[first + r] = seen.opacity;
      if (seen.opacity >= 0.5f) {
        image.depth[first + r] = seen.depth * dot(rays[r].direction, axis) / float(frame().unit_per_world);
      }
    });
    if (!image.rgb.empty()) {
      std::vector<Ab> colors = pixels ? color_->decode(*pixels) : color_->decode(*traced);
      put_colors(finished(std::move(colors)), image.luminance, first, image.rgb);
    }
    if (!image.baked_rgb.empty()) {
      std::vector<Ab> colors(rays.size());
      if (pixels) {
        color_->chromaticity->composite(*pixels, colors);
      } else {
        color_->chromaticity->composite_traced(*traced, colors);
      }
      put_colors(finished(std::move(colors)), image.luminance, first, image.baked_rgb);
    }
    if (finish_.gain() != 1) expose(first, last, image);
    if (sky_.exists() && options.sky) put_sky_behind(rays, first, image);
  }

  /// Of pixels whose colours are finished: Lab's a and b are another chromaticity in any light but the training's.
  void expose(std::size_t first, std::size_t last, RenderedImage& image) const {
    const auto brighten = [&, gain = finish_.gain()](std::size_t channels, std::vector<float>& values) {
      for (std::size_t i = channels * first; i < std::min(channels * last, values.size()); ++i) values[i] *= gain;
    };
    brighten(1, image.luminance);
    brighten(3, image.rgb);
    brighten(3, image.baked_rgb);
  }

  /// Of pixels that show the field alone so far.
  void put_sky_behind(const std::vector<Ray>& rays, std::size_t first, RenderedImage& image) const {
    parallel_each(rays.size(), kGrain, [&](std::size_t r) {
      const std::size_t pixel = first + r;
      const Vec3f behind = (1 - image.opacity[pixel]) * sky_.along(rays[r].direction);
      image.opacity[pixel] = 1;
      image.luminance[pixel] += luminance_of(behind);
      for (auto* rgb : {&image.rgb, &image.baked_rgb}) {
        for (int c = 0; c < 3 && !rgb->empty(); ++c) (*rgb)[3 * pixel + std::size_t(c)] += behind[c];
      }
    });
  }

  [[nodiscard]] std::vector<Ab> finished(std::vector<Ab> colors) const {
    if (finish_.is_plain()) return colors;
    for (Ab& color : colors) color = finish_.of(color);
    return colors;
  }

  LuminanceModel luminance_;
  std::optional<ColorModel> color_;
  Finish finish_;
  ColoredSky sky_;
};

}  // namespace

std::unique_ptr<Scene> Scene::load(const std::filesystem::path& stage1_snapshot,
                                   const std::filesystem::path& take_snapshot, const Engines& engines) {
  return load(stage1_snapshot, take_snapshot, {}, engines);
}

std::unique_ptr<Scene> Scene::load(const std::filesystem::path& stage1_snapshot,
                                   const std::filesystem::path& take_snapshot, const Finish& finish,
                                   const Engines& engines) {
  return std::make_unique<TrainedScene>(stage1_snapshot, take_snapshot, finish, engines);
}

}  // namespace cnerf
