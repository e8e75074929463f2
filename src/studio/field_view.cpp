#include "src/studio/field_view.h"

#include <algorithm>
#include <array>
#include <iterator>

#include "src/base/aligned.h"
#include "src/base/parallel.h"
#include "src/studio/sparse_pixels.h"

namespace cnerf::studio {
namespace {

constexpr std::size_t kGrain = 256;         // rays or pixels of a parallel piece of work
constexpr std::size_t kPutGrain = 1 << 13;  // pixels of one that only makes sRGB of them
constexpr int kSparseLattice = 4;           // coarser ones save no rays, and lose what is thin

/// a and b of pixels, [H, W] each; none: grey.
using AbPlanes = std::array<std::span<const float>, 2>;

AbPlanes piece_of(const AbPlanes& planes, std::size_t begin, std::size_t count) {
  if (planes[0].empty()) return {};
  return {planes[0].subspan(begin, count), planes[1].subspan(begin, count)};
}

/// Exposed last: Lab's a and b are another chromaticity in any light but that of the training.
/// @param lightness  [H, W]
Picture finished(int width, int height, std::span<const float> lightness, const AbPlanes& colors,
                 const Finish& finish) {
  Picture picture{width, height, std::vector<std::uint8_t>(3 * lightness.size())};
  const Finish::Turn turn = finish.turn();
  parallel_ranges(lightness.size(), kPutGrain, [&](std::size_t begin, std::size_t end) {
    const std::size_t count = end - begin;
    AbPlanes of_piece = piece_of(colors, begin, count);
    std::vector<float> a, b;
    if (!finish.is_plain()) {
      for (std::size_t i = 0; i < of_piece[0].size(); ++i) {
        const Ab turned = turn.of(Ab{of_piece[0][i], of_piece[1][i]});
        a.push_back(turned.a);
        b.push_back(turned.b);
      }
      of_piece = {a, b};
    }
    srgb8_from_lab(lightness.subspan(begin, count), of_piece[0], of_piece[1], finish.gain(),
                   std::span(picture.rgb).subspan(3 * begin, 3 * count));
  });
  return picture;
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
  /// Until the next.
  [[nodiscard]] std::span<const Ray> rays_of(std::span<const std::size_t> wanted) {
    ensure_size(rays_, wanted.size());
    parallel_each(wanted.size(), kGrain, [&](std::size_t r) { rays_[r] = unit_.ray_of_pixel(wanted[r]); });
    return std::span(rays_).first(wanted.size());
  }
  void trace_light(std::span<const std::size_t> wanted) {
    const std::span<const Ray> rays = rays_of(wanted);
    ensure_size(results_, wanted.size());
    const auto results = std::span(results_).first(wanted.size());
    engine_.render(rays, march_, effort_, results);
    set_light(wanted, rays, results);
  }
  void trace_colors(std::span<const std::size_t> wanted) {
    const std::span<const Ray> rays = rays_of(wanted);
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
    ensure_size(light_, results.size());
    parallel_each(results.size(), kGrain, [&](std::size_t r) {
      light_[r] = results[r].luminance + light_behind(sky_, rays[r], results[r].opacity);
    });
    pixels_.set_light(wanted, std::span(light_).first(results.size()));
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
  AlignedVector<Ray> rays_;  // of the pixels that are traced now
  AlignedVector<RayResult> results_;
  AlignedVector<float> light_;
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
  const SparsePixels& pixels = drawing.pixels();
  std::vector<AbPlanes> colors;  // of each side
  for (std::size_t next_colored = 0; const Side side : sides) {
    colors.push_back(side != nullptr ? pixels.colors(next_colored++) : AbPlanes());
  }
  std::vector<Picture> pictures(sides.size());
  parallel_tasks(sides.size(), [&](std::size_t s) {
    pictures[s] = finished(camera.lens.width, camera.lens.height, pixels.lightness(), colors[s], effort.finish);
  });
  return pictures;
}

Picture draw_cached(const CachedView& view, Side side, int width, const Finish& finish) {
  const int step = std::max(1, (view.width + width - 1) / width);
  const int rows = std::max(view.height / step, 1), columns = std::max(view.width / step, 1);
  std::vector<ViewPixel> places;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
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
  std::vector<float> lightness, a, b;
  for (std::size_t p = 0; p < places.size(); ++p) {
    lightness.push_back(lightness_from_luminance(view.luminance[places[p].pixel]));
    a.push_back(colors[p].a);
    b.push_back(colors[p].b);
  }
  return finished(columns, rows, lightness, {a, b}, finish);
}

}  // namespace cnerf::studio
