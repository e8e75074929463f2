#include "src/train/chroma/known_colors.h"

#include <algorithm>
#include <cmath>
#include <queue>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/json_record.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

constexpr float kSolidOpacity = 0.5f;  // less of a pixel shows no surface

}  // namespace

float lightness_at(const CachedView& view, std::size_t pixel) {
  return std::clamp(lightness_from_luminance(view.luminance[pixel]), 0.0f, 100.0f);
}

KnownColors resized_to(const KnownColors& known, const CachedView& view) {
  if (known.width == view.width && known.height == view.height) return known;
  KnownColors out{known.kind, known.view, view.width, view.height, {}, {}, {}, known.everywhere};
  const std::size_t pixels = std::size_t(view.width) * std::size_t(view.height);
  std::vector<double> sum(2 * pixels), count(pixels), all(pixels);
  if (!known.reach.empty()) out.reach.resize(pixels);
  const auto add = [&](int from_x, int from_y, int x, int y) {
    const std::size_t to = std::size_t(y) * std::size_t(view.width) + std::size_t(x);
    const std::size_t from = std::size_t(from_y) * std::size_t(known.width) + std::size_t(from_x);
    all[to] += 1;
    if (known.is_known[from] == 0) return;
    count[to] += 1;
    sum[2 * to] += known.ab[from].a;
    sum[2 * to + 1] += known.ab[from].b;
    if (!known.reach.empty()) out.reach[to] = std::max(out.reach[to], known.reach[from]);
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
  const double least = known.kind == KnownColorKind::kStrokes ? 0 : 0.5;  // of what a pixel covers
  for (std::size_t p = 0; p < pixels; ++p) {
    out.is_known.push_back(count[p] > 0 && count[p] >= least * all[p] ? 1 : 0);
    out.ab.push_back(out.is_known[p] != 0 ? Ab{float(sum[2 * p] / count[p]), float(sum[2 * p + 1] / count[p])} : Ab{});
  }
  return out;
}

std::string describe(std::span<const KnownColors> known) {
  std::string text;
  for (const KnownColors& one : known) {
    std::string content(reinterpret_cast<const char*>(one.is_known.data()), one.is_known.size());
    content.append(reinterpret_cast<const char*>(one.ab.data()), one.ab.size() * sizeof(Ab));
    content.append(reinterpret_cast<const char*>(one.reach.data()), one.reach.size() * sizeof(float));
    if (one.everywhere) content += "everywhere";
    text += one.kind == KnownColorKind::kKeyFrame ? " + key frame " : " + hints on ";
    text += one.view + " (" + sha256(std::as_bytes(std::span(content))).substr(0, 8) + ")";
  }
  return text;
}

std::string describe_viewpoints(std::span<const Viewpoint> viewpoints) {
  std::string text;
  for (const Viewpoint& viewpoint : viewpoints) {
    const std::string camera = json_of(viewpoint.camera).dump();
    text += " + " + viewpoint.name + " (" + sha256(std::as_bytes(std::span(camera))).substr(0, 8) + ")";
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

RunningColors running_colors(const KnownColors& strokes) {
  RunningColors colors{strokes.ab, strokes.reach, {}};
  if (colors.reach.empty()) colors.reach.assign(colors.ab.size(), 1.0f);
  for (const std::uint8_t is_known : strokes.is_known) colors.cost.push_back(is_known != 0 ? 0.0f : kUnreached);
  return colors;
}

void run(RunningColors& colors, const CachedView& view, std::span<const float> surface, const StrokeReach& reach) {
  CNERF_CHECK(colors.cost.size() == view.opacity.size(), "colours of the view's size");
  const float one_pixel = 1.0f / (reach.share_of_short_side * float(view.short_side()));
  std::vector<float> lightness(colors.cost.size()), log_distance(colors.cost.size());
  using Entry = std::pair<float, std::uint32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  for (std::uint32_t p = 0; p < colors.cost.size(); ++p) {
    lightness[p] = lightness_at(view, p);
    log_distance[p] = surface[p] > 0 ? std::log(surface[p]) : 0;
    if (colors.is_known(p)) open.emplace(colors.cost[p], p);
  }
  while (!open.empty()) {
    const auto [so_far, p] = open.top();
    open.pop();
    const float further = colors.reach[p];
    if (so_far > colors.cost[p] || further <= 0) continue;
    const int x = int(p) % view.width, y = int(p) / view.width;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int nx = x + dx, ny = y + dy;
        if ((dx == 0 && dy == 0) || nx < 0 || ny < 0 || nx >= view.width || ny >= view.height) continue;
        const auto q = std::uint32_t(ny * view.width + nx);
        if (surface[p] <= 0 || surface[q] <= 0) continue;
        const float step = one_pixel * std::hypot(float(dx), float(dy)) +
                           std::abs(lightness[p] - lightness[q]) / reach.lightness +
                           std::abs(log_distance[q] - log_distance[p]) / reach.depth;
        const float cost = so_far + step / further;
        if (cost >= std::min(colors.cost[q], 1.0f)) continue;
        colors.cost[q] = cost;
        colors.ab[q] = colors.ab[p];
        colors.reach[q] = further;
        open.emplace(cost, q);
      }
    }
  }
}

}  // namespace cnerf
