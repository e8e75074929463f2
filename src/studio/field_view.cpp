#include "src/studio/field_view.h"

#include <algorithm>
#include <iterator>

#include "src/base/parallel.h"
#include "src/studio/sparse_pixels.h"

namespace cnerf::studio {
namespace {

constexpr std::size_t kGrain = 256;  // rays or pixels of a parallel piece of work
constexpr int kSparseLattice = 4;    // coarser ones save no rays, and lose what is thin

/// Linear Rec.709. Exposed last: Lab's a and b are another chromaticity in any light but that of the training.
Vec3f finished(const Lab<float>& color, const Finish& finish) {
  if (finish.is_plain()) return gamut_mapped_linear_rgb_from_lab(color);
  const Ab ab = finish.of(Ab{color.a, color.b});
  return finish.gain() * gamut_mapped_linear_rgb_from_lab<float>({color.lightness, ab.a, ab.b});
}

void put(const Lab<float>& color, const Finish& finish, std::size_t pixel, Picture& picture) {
  const Vec3f rgb = finished(color, finish);
  for (int c = 0; c < 3; ++c) picture.rgb[3 * pixel + std::size_t(c)] = srgb8_from_linear(rgb[c]);
}

Picture blank(int width, int height) {
  return {width, height, std::vector<std::uint8_t>(3 * std::size_t(width) * std::size_t(height))};
}

/// One drawing: which pixels are traced, and what is seen there.
class Drawing {
 public:
  Drawing(const LuminanceModel& luminance, const FieldCamera& camera, std::span<const Side> colored,
          const DrawingEffort& effort)
      : engine_(*luminance.engine),
        unit_(camera.lens, camera.world_from_camera, luminance.frame),
        march_(luminance.march(effort.steps_per_box)),
        effort_(effort.rays),
        colored_(colored),
        sky_(luminance.sky_light()),
        pixels_(camera.lens.width, camera.lens.height, lattice_of(camera.lens, effort), colored.size()) {}

  /// @return  false where it was told to stop
  bool trace(const std::function<bool()>& keep_going, DrawingCosts& costs) {
    for (std::size_t pass = 0; pass < pixels_.passes(); ++pass) {
      const std::vector<std::size_t> wanted = pixels_.foretell(pass);
      const bool needs_colors = pixels_.needs_colors(pass);
      costs.rays += wanted.size();
      costs.colored_rays += needs_colors ? wanted.size() : 0;
      const std::size_t at_a_time = engine_.rays_at_a_time();
      for (std::size_t first = 0; first < wanted.size(); first += at_a_time) {
        if (!keep_going()) return false;
        const auto part = std::span(wanted).subspan(first, std::min(at_a_time, wanted.size() - first));
        needs_colors ? trace_colors(part) : trace_light(part);
      }
    }
    pixels_.spread_colors();
    return true;
  }
  [[nodiscard]] const SparsePixels& pixels() const { return pixels_; }

 private:
  static int lattice_of(const Intrinsics& lens, const DrawingEffort& effort) {
    const std::size_t count = std::size_t(lens.width) * std::size_t(lens.height);
    return effort.least_sparse_pixels > 0 && count >= effort.least_sparse_pixels ? kSparseLattice : 1;
  }
  [[nodiscard]] std::vector<Ray> rays_of(std::span<const std::size_t> wanted) const {
    std::vector<Ray> rays(wanted.size());
    parallel_each(rays.size(), kGrain, [&](std::size_t r) { rays[r] = unit_.ray_of_pixel(wanted[r]); });
    return rays;
  }
  void trace_light(std::span<const std::size_t> wanted) {
    const std::vector<Ray> rays = rays_of(wanted);
    std::vector<RayResult> results(wanted.size());
    engine_.render(rays, march_, effort_, results);
    set_light(wanted, rays, results);
  }
  void trace_colors(std::span<const std::size_t> wanted) {
    const std::vector<Ray> rays = rays_of(wanted);
    const auto seen = engine_.trace_pixels(rays, march_, effort_);
    set_light(wanted, rays, seen->results());
    for (std::size_t s = 0; s < colored_.size(); ++s) {
      std::vector<Ab> colors = colored_[s]->decode(*seen);
      if (sky_.values != nullptr && colored_[s]->sky.exists()) {
        put_sky_behind(colored_[s]->sky, rays, seen->results(), colors);
      }
      pixels_.set_colors(s, wanted, colors);
    }
  }
  void set_light(std::span<const std::size_t> wanted, std::span<const Ray> rays, std::span<const RayResult> results) {
    std::vector<float> light(results.size());
    parallel_each(light.size(), kGrain, [&](std::size_t r) {
      light[r] = results[r].luminance + light_behind(sky_, rays[r], results[r].opacity);
    });
    pixels_.set_light(wanted, light);
  }
  void put_sky_behind(const SkyColors& sky, std::span<const Ray> rays, std::span<const RayResult> seen,
                      std::vector<Ab>& colors) const {
    parallel_each(rays.size(), kGrain, [&](std::size_t r) {
      const float behind = light_behind(sky_, rays[r], seen[r].opacity);
      if (behind > 0) colors[r] = mixed(colors[r], seen[r].luminance, sky.along(rays[r].direction), behind);
    });
  }

  const LuminanceEngine& engine_;
  UnitCamera unit_;
  MarchSettings march_;
  RenderEffort effort_;
  std::span<const Side> colored_;
  DirectionView sky_;
  SparsePixels pixels_;
};

}  // namespace

std::vector<Picture> draw_field(const LuminanceModel& luminance, const FieldCamera& camera, std::span<const Side> sides,
                                const DrawingEffort& effort, const std::function<bool()>& keep_going,
                                DrawingCosts* costs) {
  std::vector<Side> colored;
  std::ranges::copy_if(sides, std::back_inserter(colored), [](Side side) { return side != nullptr; });
  Drawing drawing(luminance, camera, colored, effort);
  DrawingCosts unwanted;
  if (!drawing.trace(keep_going, costs != nullptr ? *costs : unwanted)) return {};
  std::vector<Picture> pictures(sides.size());
  std::vector<std::size_t> colors;  // of each side
  for (std::size_t next_colored = 0; const Side side : sides) {
    colors.push_back(side != nullptr ? next_colored++ : SparsePixels::kGrey);
  }
  parallel_tasks(sides.size(), [&](std::size_t s) {
    pictures[s] = blank(camera.lens.width, camera.lens.height);
    parallel_each(pictures[s].rgb.size() / 3, kGrain,
                  [&](std::size_t p) { put(drawing.pixels().lab(colors[s], p), effort.finish, p, pictures[s]); });
  });
  return pictures;
}

Picture draw_cached(const CachedView& view, Side side, int width, const Finish& finish) {
  const int step = std::max(1, (view.width + width - 1) / width);
  Picture picture = blank(std::max(view.width / step, 1), std::max(view.height / step, 1));
  std::vector<ViewPixel> places;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const int column = std::min(x * step + step / 2, view.width - 1);
      const int row = std::min(y * step + step / 2, view.height - 1);
      places.push_back({0, std::uint32_t(row * view.width + column)});
    }
  }
  std::vector<Ab> colors(places.size());
  if (side != nullptr) {
    const PixelSamples samples = pixel_samples(std::span(&view, 1), places);
    colors = side->decode(samples);
    const std::vector<float> field = pixel_luminance(samples);
    for (std::size_t p = 0; p < places.size() && side->sky.exists(); ++p) {
      colors[p] = side->sky.behind(view, places[p].pixel, field[p], colors[p]);
    }
  }
  parallel_each(places.size(), kGrain, [&](std::size_t p) {
    const float lightness = lightness_from_luminance(view.luminance[places[p].pixel]);
    put({lightness, colors[p].a, colors[p].b}, finish, p, picture);
  });
  return picture;
}

}  // namespace cnerf::studio
