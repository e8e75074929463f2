#include "src/train/scene.h"

#include <algorithm>
#include <optional>

#include "src/base/parallel.h"
#include "src/picture/picture.h"
#include "src/train/chroma/color_model.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/view_cache.h"

namespace cnerf {

namespace {

constexpr std::size_t kGrain = 256;          // rays of a parallel piece of work
constexpr std::size_t kRaysAtATime = 16384;  // bounds the memory of traced samples
constexpr float kShadedShare = 0.995f;       // what the rest could change is below a grey level of an 8-bit picture

/// Colours of the pixels from `first` on, at their luminance, to an image of three interleaved channels.
void put_colors(const std::vector<Ab>& colors, const std::vector<float>& luminance, std::size_t first,
                std::vector<float>& image) {
  parallel_ranges(colors.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3f rgb = linear_rgb_at(luminance[first + i], colors[i]);
      for (int c = 0; c < 3; ++c) image[3 * (first + i) + std::size_t(c)] = rgb[c];
    }
  });
}

/// What rays met.
struct Trace {
  std::vector<WeightedSample> samples;
  std::vector<std::size_t> offsets;
};

class TrainedScene final : public Scene {
 public:
  TrainedScene(const std::filesystem::path& stage1_snapshot, const std::filesystem::path& take_snapshot,
               const Finish& finish, const Engines& engines)
      : luminance_(LuminanceModel::load(stage1_snapshot, engines)), finish_(finish) {
    if (!take_snapshot.empty()) color_ = ColorModel::load(take_snapshot, engines);
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
    for (std::size_t first = 0; first < n; first += kRaysAtATime) {
      render_part(camera, options, first, std::min(n, first + kRaysAtATime), image);
    }
    return image;
  }

 private:
  static void replace_luminance(std::span<const Ray> rays, const RenderOptions& options, Trace& traced) {
    std::vector<Vec3f> positions;
    for (std::size_t r = 0; r < rays.size(); ++r) {
      for (std::size_t s = traced.offsets[r]; s < traced.offsets[r + 1]; ++s) {
        positions.push_back(rays[r].origin + rays[r].direction * traced.samples[s].t);
      }
    }
    std::vector<float> luminance(positions.size());
    options.luminance(positions, luminance);
    for (std::size_t s = 0; s < luminance.size(); ++s) traced.samples[s].luminance = luminance[s];
  }

  void render_part(const UnitCamera& camera, const RenderOptions& options, std::size_t first, std::size_t last,
                   RenderedImage& image) const {
    std::vector<Ray> rays(last - first);
    parallel_ranges(rays.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r) rays[r] = camera.ray_of_pixel(first + r);
    });
    Trace traced;
    luminance_.engine->trace(rays, luminance_.march(options.steps_per_box),
                             {float(options.min_transmittance), kShadedShare}, traced.samples, traced.offsets);
    if (options.luminance) {
      replace_luminance(rays, options, traced);
    } else if (!finish_.is_plain()) {
      for (WeightedSample& sample : traced.samples) sample.luminance *= finish_.gain();
    }
    const std::vector<WeightedSample>& samples = traced.samples;
    const std::vector<std::size_t>& offsets = traced.offsets;
    const Vec3f axis = camera.unit_from_camera.column(2).cast<float>();
    parallel_ranges(rays.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r) {
        float weighted_t = 0;
        for (std::size_t s = offsets[r]; s < offsets[r + 1]; ++s) {
          image.luminance[first + r] += samples[s].weight * samples[s].luminance;
          image.opacity[first + r] += samples[s].weight;
          weighted_t += samples[s].weight * samples[s].t;
        }
        if (image.opacity[first + r] >= 0.5f) {
          const float t = weighted_t / image.opacity[first + r];
          image.depth[first + r] = t * dot(rays[r].direction, axis) / float(frame().unit_per_world);
        }
      }
    });
    if (image.rgb.empty() && image.baked_rgb.empty()) return;

    const PixelSamples pixels = pixel_samples(rays, samples, offsets);
    if (!image.rgb.empty()) put_colors(finished(color_->decode(pixels)), image.luminance, first, image.rgb);
    if (!image.baked_rgb.empty()) {
      std::vector<Ab> colors(rays.size());
      color_->chromaticity->composite(pixels, colors);
      put_colors(finished(std::move(colors)), image.luminance, first, image.baked_rgb);
    }
  }

  [[nodiscard]] std::vector<Ab> finished(std::vector<Ab> colors) const {
    for (Ab& color : colors) color = finish_.of(color);
    return colors;
  }

  LuminanceModel luminance_;
  std::optional<ColorModel> color_;
  Finish finish_;
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
