#include "src/compare/consistency.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "src/base/check.h"
#include "src/base/statistics.h"
#include "src/color/ab_bins.h"

namespace cnerf::compare {
namespace {

constexpr float kSolidOpacity = 0.9f;

/// ab and depth of a view, looked up between pixels.
class AbMap {
 public:
  explicit AbMap(const SeenView& view) : view_(view) {
    const std::vector<float>& rgb = view.image->rgb;
    ab_.reserve(rgb.size() / 3);
    for (std::size_t i = 0; i + 2 < rgb.size(); i += 3) {
      ab_.push_back(ab_of_linear_rgb({rgb[i], rgb[i + 1], rgb[i + 2]}));
    }
  }

  [[nodiscard]] Ab at(std::size_t pixel) const { return ab_[pixel]; }

  /// The colour at a place where all four neighbours show a surface at `depth`; NaN where they do not.
  [[nodiscard]] Ab at(PixelPosition place, double depth) const {
    constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
    const double x = place.x - 0.5, y = place.y - 0.5;
    const int x0 = int(std::floor(x)), y0 = int(std::floor(y));
    if (x0 < 0 || y0 < 0 || x0 + 1 >= view_.image->width || y0 + 1 >= view_.image->height) return {kNone, kNone};
    const auto fx = float(x - x0), fy = float(y - y0);
    Ab sum;
    for (int corner = 0; corner < 4; ++corner) {
      const int dx = corner % 2, dy = corner / 2;
      const std::size_t i = std::size_t(y0 + dy) * std::size_t(view_.image->width) + std::size_t(x0 + dx);
      const bool is_solid = view_.image->opacity[i] >= kSolidOpacity;
      if (!is_solid || std::abs(double(view_.image->depth[i]) - depth) > kSameDepth * depth) return {kNone, kNone};
      const float weight = (dx == 1 ? fx : 1 - fx) * (dy == 1 ? fy : 1 - fy);
      sum.a += weight * ab_[i].a;
      sum.b += weight * ab_[i].b;
    }
    return sum;
  }

 private:
  const SeenView& view_;
  std::vector<Ab> ab_;
};

void check(const SeenView& view) {
  const std::size_t pixels = std::size_t(view.image->width) * std::size_t(view.image->height);
  CNERF_CHECK_EQ(view.image->rgb.size(), 3 * pixels);
  CNERF_CHECK_EQ(view.image->depth.size(), pixels);
  CNERF_CHECK_EQ(view.image->opacity.size(), pixels);
}

}  // namespace

std::vector<CarriedPixel> carried_pixels(const SeenView& from, const SeenView& to) {
  check(from);
  check(to);
  const AbMap here(from), there(to);
  const Affined to_from_world = to.world_from_camera.inverse();
  std::vector<CarriedPixel> pixels;
  for (int y = 0; y < from.image->height; ++y) {
    for (int x = 0; x < from.image->width; ++x) {
      const std::size_t i = std::size_t(y) * std::size_t(from.image->width) + std::size_t(x);
      if (from.image->opacity[i] < kSolidOpacity || from.image->depth[i] <= 0) continue;
      const Vec3d direction = ray_direction(from.intrinsics, {x + 0.5, y + 0.5});
      const Vec3d point = from.world_from_camera.point(direction * (double(from.image->depth[i]) / direction.z));
      const Vec3d in_camera = to_from_world.point(point);
      const auto place = project(to.intrinsics, in_camera);
      if (!place) continue;
      const Ab found = there.at(*place, in_camera.z), carried = here.at(i);
      if (std::isnan(found.a)) continue;
      pixels.push_back({std::hypot(found.a - carried.a, found.b - carried.b), std::hypot(carried.a, carried.b)});
    }
  }
  return pixels;
}

Consistency consistency(std::span<const SeenView> sequence, std::size_t step) {
  CNERF_CHECK(step > 0, "a step of at least one");
  std::vector<float> all;
  double chroma = 0;
  for (std::size_t i = 0; i + step < sequence.size(); ++i) {
    for (const auto& [from, to] : {std::pair{i, i + step}, std::pair{i + step, i}}) {
      for (const CarriedPixel& pixel : carried_pixels(sequence[from], sequence[to])) {
        all.push_back(pixel.distance);
        chroma += double(pixel.chroma);
      }
    }
  }
  if (all.empty()) return {};
  Consistency result;
  result.pixels = all.size();
  result.mean = std::accumulate(all.begin(), all.end(), 0.0) / double(all.size());
  result.chroma = chroma / double(all.size());
  result.p95 = quantile(std::move(all), 0.95);
  return result;
}

}  // namespace cnerf::compare
