#include "src/train/chroma/likeness.h"

#include <algorithm>
#include <cmath>
#include <queue>
#include <tuple>

#include "src/base/check.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

constexpr int kAround = 2;  // pixels on each side that looks are a mean of
// What costs 1 from a stroke to a pixel that is like it, whatever lies between them. The error hardly depends on these:
// docs/history/decisions.md, 59.
constexpr float kLightness = 12;    // L* up and down
constexpr float kTexture = 6;       // L*
constexpr float kDepth = 0.2f;      // of the distance
constexpr float kAlike = 0.5f;      // and to be like it costs so much more than to be joined to it
constexpr float kNoSurface = 0.5f;  // between what shows a surface and what does not
constexpr float kSoft = 0.2f;       // of two colours whose costs differ by this, the dearer counts e times less
constexpr float kBlack = 16;  // L* where chroma has gone to nothing below black: in Lab, shade scales a, b and L* + 16
constexpr std::size_t kMostSamples = 400;      // of all colours of a view, each as many
constexpr std::size_t kPixelsPerPiece = 1024;  // pixels of a parallel piece of work

bool same(Ab x, Ab y) {
  return x.a == y.a && x.b == y.b;
}

template <typename Visit>
void for_each_neighbour(const CachedView& view, std::uint32_t p, Visit&& visit) {
  const int x = int(p) % view.width, y = int(p) / view.width;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const int nx = x + dx, ny = y + dy;
      if ((dx == 0 && dy == 0) || nx < 0 || ny < 0 || nx >= view.width || ny >= view.height) continue;
      visit(std::uint32_t(ny * view.width + nx), dx != 0 && dy != 0 ? std::sqrt(2.0f) : 1.0f);
    }
  }
}

/// What a way costs from a pixel to one beside it; as `run` has it, but what shows no surface is passed too.
struct StepCost {
  const CachedView& view;
  const PixelLooks& looks;
  std::vector<float> lightness;
  float one_pixel;
  StepCost(const CachedView& of, const PixelLooks& l) : view(of), looks(l) {
    const StrokeReach reach;
    one_pixel = 1.0f / (reach.share_of_short_side * float(of.short_side()));
    for (std::size_t p = 0; p < of.opacity.size(); ++p) lightness.push_back(lightness_at(of, p));
  }
  float operator()(std::uint32_t p, std::uint32_t q, float distance) const {
    const StrokeReach reach;
    const float a = looks.surface[p], b = looks.surface[q];
    const float depth = a > 0 && b > 0 ? std::abs(std::log(a / b)) / reach.depth : (a > 0) != (b > 0) ? kNoSurface : 0;
    return one_pixel * distance + std::abs(lightness[p] - lightness[q]) / reach.lightness + depth;
  }
};

}  // namespace

PixelLooks::PixelLooks(const CachedView& view, std::span<const float> of_view) : surface(of_view) {
  const int r = kAround;
  const std::size_t n = view.opacity.size();
  std::vector<float> own(n);
  for (std::size_t p = 0; p < n; ++p) own[p] = lightness_at(view, p);
  lightness.resize(n);
  texture.resize(n);
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      float sum = 0, squares = 0, count = 0;
      for (int j = std::max(y - r, 0); j <= std::min(y + r, view.height - 1); ++j) {
        for (int i = std::max(x - r, 0); i <= std::min(x + r, view.width - 1); ++i) {
          const float l = own[std::size_t(j) * std::size_t(view.width) + std::size_t(i)];
          sum += l;
          squares += l * l;
          count += 1;
        }
      }
      const auto p = std::size_t(y) * std::size_t(view.width) + std::size_t(x);
      lightness[p] = sum / count;
      texture[p] = std::sqrt(std::max(squares / count - lightness[p] * lightness[p], 0.0f));
    }
  }
}

void Claims::add(const Claim& claim) {
  const auto& [cost, color, lightness] = claim;
  std::size_t at = 0;
  while (at < kMost && list[at].cost <= cost && list[at].cost < kUnreached) {
    if (same(list[at].color, color)) return;
    ++at;
  }
  if (at == kMost || cost >= kUnreached) return;
  std::size_t last = at;
  while (last + 1 < kMost && list[last].cost < kUnreached && !same(list[last].color, color)) ++last;
  for (; last > at; --last) list[last] = list[last - 1];
  list[at] = claim;
}

bool Claims::has(Ab color) const {
  return std::ranges::any_of(list, [&](const Claim& c) { return c.cost < kUnreached && same(c.color, color); });
}

Ab Claims::mixed(float lightness) const {
  if (list[0].cost <= 0) return list[0].color;
  Ab sum;
  float total = 0;
  for (const Claim& claim : list) {
    if (claim.cost >= kUnreached) break;
    const float weight = std::exp((list[0].cost - claim.cost) / kSoft);
    const float share = std::min((lightness + kBlack) / (claim.lightness + kBlack), 1.0f);  // shade takes chroma too
    sum = {sum.a + share * weight * claim.color.a, sum.b + share * weight * claim.color.b};
    total += weight;
  }
  return total > 0 ? Ab{sum.a / total, sum.b / total} : Ab{};
}

StrokesEverywhere::StrokesEverywhere(const RunningColors& strokes, const CachedView& view,
                                     std::span<const float> surface)
    : view_(view), claims_(view.opacity.size()) {
  CNERF_CHECK(strokes.cost.size() == view.opacity.size(), "strokes of the view's size");
  const PixelLooks looks(view, surface);
  take_samples(strokes, looks);
  run(strokes, looks);
}

void StrokesEverywhere::take_samples(const RunningColors& strokes, const PixelLooks& looks) {
  std::vector<std::uint32_t> painted, color_of;
  std::vector<std::size_t> count;
  for (std::uint32_t p = 0; p < strokes.cost.size(); ++p) {
    if (!strokes.is_known(p) || strokes.reach[p] <= 0) continue;
    const Ab color = strokes.ab[p];
    color_of.push_back(number_of(color));
    if (color_of.back() == count.size()) {
      colors_.push_back(color);
      count.push_back(0);
      lightness_.push_back(0);
      reach_.push_back(0);
    }
    ++count[color_of.back()];
    lightness_[color_of.back()] += looks.lightness[p];
    reach_[color_of.back()] = std::max(reach_[color_of.back()], strokes.reach[p]);
    painted.push_back(p);
  }
  if (painted.empty()) return;
  for (std::size_t c = 0; c < colors_.size(); ++c) lightness_[c] /= float(count[c]);
  const std::size_t each = std::max<std::size_t>(kMostSamples / colors_.size(), 1);
  std::vector<std::size_t> passed(colors_.size());
  for (std::size_t i = 0; i < painted.size(); ++i) {
    const std::uint32_t color = color_of[i], p = painted[i];
    const std::size_t every = (count[color] + each - 1) / each;
    if (passed[color]++ % every != every / 2) continue;
    samples_.push_back({view_.camera.ray_of_pixel(p).direction, looks.surface[p] > 0 ? std::log(looks.surface[p]) : 0,
                        looks.lightness[p], looks.texture[p], color});
  }
}

void StrokesEverywhere::claim_alike(const CachedView& view, const PixelLooks& looks, std::size_t p, Claims& to) const {
  const Ray ray = view.camera.ray_of_pixel(p);
  const bool is_solid = looks.surface[p] > 0;
  const Vec3f from = ray.at(is_solid ? looks.surface[p] : 1e3f) - view_.camera.origin.cast<float>();
  const float distance = length(from), log_distance = std::log(distance);
  const Vec3f direction = from / distance;
  const StrokeReach reach;
  const float one_angle = reach.share_of_short_side * float(view_.short_side()) / float(view_.camera.intrinsics.fx);
  std::vector<float> least(colors_.size(), kUnreached);
  for (const Sample& sample : samples_) {
    const float angle = std::sqrt(std::max(2 - 2 * dot(direction, sample.direction), 0.0f));
    const float depth =
        is_solid && sample.log_distance != 0 ? std::abs(log_distance - sample.log_distance) / kDepth : kNoSurface;
    const float cost = angle / one_angle + depth + std::abs(looks.lightness[p] - sample.lightness) / kLightness +
                       std::abs(looks.texture[p] - sample.texture) / kTexture;
    least[sample.color] = std::min(least[sample.color], (kAlike + cost) / reach_[sample.color]);
  }
  for (std::size_t c = 0; c < least.size(); ++c) to.add({least[c], colors_[c], lightness_[c]});
}

/// Of a number that no colour has where it is none of them.
std::uint32_t StrokesEverywhere::number_of(Ab color) const {
  const auto is_it = [&](Ab other) { return same(other, color); };
  return std::uint32_t(std::ranges::find_if(colors_, is_it) - colors_.begin());
}

/// As `run`, but of each pixel the cheapest ways of several colours are kept, and ways begin at likeness too.
void StrokesEverywhere::run(const RunningColors& strokes, const PixelLooks& looks) {
  using Entry = std::tuple<float, std::uint32_t, std::uint32_t>;  // cost, pixel, colour: ties have an order
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  std::vector<Claims> alike(claims_.size());
  parallel_ranges(claims_.size(), kPixelsPerPiece, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      if (!strokes.is_known(p)) claim_alike(view_, looks, p, alike[p]);
    }
  });
  for (std::uint32_t p = 0; p < claims_.size(); ++p) {
    for (const Claims::Claim& claim : alike[p].list) {
      if (claim.cost < kUnreached) open.emplace(claim.cost, p, number_of(claim.color));
    }
    if (!strokes.is_known(p)) continue;
    if (strokes.reach[p] > 0) {
      open.emplace(0.0f, p, number_of(strokes.ab[p]));
    } else {
      claims_[p].add({0, strokes.ab[p]});
    }
  }
  const StepCost step(view_, looks);
  // What is painted has its colour alone, and lets nothing else through.
  const auto is_closed = [&](std::uint32_t p, std::uint32_t color) {
    return claims_[p].cost() <= 0 || claims_[p].is_full() || claims_[p].has(colors_[color]);
  };
  while (!open.empty()) {
    const auto [cost, p, color] = open.top();
    open.pop();
    if (is_closed(p, color)) continue;
    claims_[p].add({cost, colors_[color], lightness_[color]});
    for_each_neighbour(view_, p, [&, cost = cost, p = p, color = color](std::uint32_t q, float distance) {
      if (!is_closed(q, color)) open.emplace(cost + step(p, q, distance) / reach_[color], q, color);
    });
  }
}

}  // namespace cnerf
