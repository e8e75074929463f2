#include "src/train/chroma/known_colors.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

constexpr float kSolidOpacity = 0.5f;  // less of a pixel shows no surface

}  // namespace

float lightness_at(const CachedView& view, std::size_t pixel) {
  return std::clamp(lightness_from_luminance(view.luminance[pixel]), 0.0f, 100.0f);
}

KnownColors resized_to(const KnownColors& known, const CachedView& view) {
  KnownColors out{known.kind, known.view, view.width, view.height, {}, {}};
  const std::size_t pixels = std::size_t(view.width) * std::size_t(view.height);
  std::vector<double> sum(2 * pixels), count(pixels), all(pixels);
  const auto add = [&](int from_x, int from_y, int x, int y) {
    const std::size_t to = std::size_t(y) * std::size_t(view.width) + std::size_t(x);
    const std::size_t from = std::size_t(from_y) * std::size_t(known.width) + std::size_t(from_x);
    all[to] += 1;
    if (known.is_known[from] == 0) return;
    count[to] += 1;
    sum[2 * to] += known.ab[from].a;
    sum[2 * to + 1] += known.ab[from].b;
  };
  // Every pixel of the larger of the two images belongs to one of the smaller.
  const auto of = [](int i, int from, int to) { return std::min(int((i + 0.5) * to / from), to - 1); };
  for (int y = 0; y < std::max(known.height, view.height); ++y) {
    for (int x = 0; x < std::max(known.width, view.width); ++x) {
      const bool shrinks_x = known.width > view.width, shrinks_y = known.height > view.height;
      add(shrinks_x ? x : of(x, view.width, known.width), shrinks_y ? y : of(y, view.height, known.height),
          shrinks_x ? of(x, known.width, view.width) : x, shrinks_y ? of(y, known.height, view.height) : y);
    }
  }
  for (std::size_t p = 0; p < pixels; ++p) {
    out.is_known.push_back(count[p] > 0 && 2 * count[p] >= all[p] ? 1 : 0);
    out.ab.push_back(out.is_known[p] != 0 ? Ab{float(sum[2 * p] / count[p]), float(sum[2 * p + 1] / count[p])} : Ab{});
  }
  return out;
}

std::string describe(std::span<const KnownColors> known) {
  std::string text;
  for (const KnownColors& one : known) {
    std::string content(reinterpret_cast<const char*>(one.is_known.data()), one.is_known.size());
    content.append(reinterpret_cast<const char*>(one.ab.data()), one.ab.size() * sizeof(Ab));
    text += one.kind == KnownColorKind::kKeyFrame ? " + key frame " : " + hints on ";
    text += one.view + " (" + sha256(std::as_bytes(std::span(content))).substr(0, 8) + ")";
  }
  return text;
}

std::vector<float> surface_distance(const CachedView& view) {
  std::vector<float> surface(view.opacity.size(), 0.0f);
  for (std::size_t p = 0; p < surface.size(); ++p) {
    if (view.opacity[p] < kSolidOpacity) continue;
    double total = 0, passed = 0;
    for (std::size_t s = view.offsets[p]; s < view.offsets[p + 1]; ++s) total += view.samples[s].weight;
    for (std::size_t s = view.offsets[p]; s < view.offsets[p + 1] && 2 * passed < total; ++s) {
      passed += view.samples[s].weight;
      surface[p] = view.samples[s].t;
    }
  }
  return surface;
}

KnownColors spread(const KnownColors& strokes, const CachedView& view, std::span<const float> surface,
                   const StrokeReach& reach) {
  CNERF_CHECK(strokes.width == view.width && strokes.height == view.height, "strokes of the view's size");
  KnownColors out = strokes;
  std::vector<float> cost(out.ab.size(), std::numeric_limits<float>::infinity());
  using Entry = std::pair<float, std::uint32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  for (std::uint32_t p = 0; p < cost.size(); ++p) {
    if (strokes.is_known[p] == 0) continue;
    cost[p] = 0;
    open.emplace(0.0f, p);
  }
  const float one_pixel = 1.0f / (reach.share_of_short_side * float(view.short_side()));
  while (!open.empty()) {
    const auto [so_far, p] = open.top();
    open.pop();
    if (so_far > cost[p]) continue;
    out.is_known[p] = 1;
    const int x = int(p) % view.width, y = int(p) / view.width;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int nx = x + dx, ny = y + dy;
        if ((dx == 0 && dy == 0) || nx < 0 || ny < 0 || nx >= view.width || ny >= view.height) continue;
        const auto q = std::uint32_t(ny * view.width + nx);
        if (surface[p] <= 0 || surface[q] <= 0) continue;
        const float step = one_pixel * std::hypot(float(dx), float(dy)) +
                           std::abs(lightness_at(view, p) - lightness_at(view, q)) / reach.lightness +
                           std::abs(std::log(surface[q] / surface[p])) / reach.depth;
        if (so_far + step >= std::min(cost[q], 1.0f)) continue;
        cost[q] = so_far + step;
        out.ab[q] = out.ab[p];
        open.emplace(cost[q], q);
      }
    }
  }
  return out;
}

}  // namespace cnerf
