#include "src/train/chroma/likeness.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "src/base/check.h"
#include "src/base/exp_of_negative.h"
#include "src/base/parallel.h"
#include "src/base/vector_clones.h"

namespace cnerf {
namespace {

constexpr int kAround = 2;  // pixels on each side that looks are a mean of
// What costs 1 from a stroke to a pixel that is like it, whatever lies between them. The error hardly depends on these:
// docs/history/decisions.md, 59.
constexpr float kPlane = 0.35f;     // of the short side, in the plane of the painted view
constexpr float kLightness = 12;    // L* up and down
constexpr float kTexture = 6;       // L*
constexpr float kDepth = 0.2f;      // of the distance
constexpr float kNoSurface = 0.5f;  // between what shows a surface and what does not
constexpr float kAlike = 0.5f;      // and to be like it costs so much more than to be joined to it
constexpr float kSpread = 0.8f;     // a sample that costs this more counts e times less
constexpr float kSoft = 0.2f;       // of two colours whose costs differ by this, the dearer counts e times less
constexpr float kShare = 0.4f;      // the same, while shares of colours are smoothed
constexpr float kLeastShare = 1e-4f;
constexpr float kSmoothRadius = 0.04f;   // of the short side
constexpr int kFilterRadius = 7;         // pixels, at least, of the smaller images that slopes come from
constexpr float kSmallContrast = 0.05f;  // of a guide, squared: what differs less is smoothed as one
constexpr float kBlack = 16;  // L* where chroma has gone to nothing below black: in Lab, shade scales a, b and L* + 16
constexpr std::size_t kMostColors = 64;        // told apart: a painted picture has more, and few pixels of each
constexpr float kSmallestCell = 1;             // of ab, where there are more
constexpr std::size_t kMostSamples = 400;      // of all colours of a view, each as many
constexpr std::size_t kPixelsPerPiece = 1024;  // pixels of a parallel piece of work
constexpr std::size_t kSamplesAtOnce = 16;     // that become vector instructions
constexpr float kLikeNothing = 1e6f;           // L*

bool same(Ab x, Ab y) {
  return x.a == y.a && x.b == y.b;
}

/// The cell of ab that a colour lies in: of the given side, or 0 for one of its own.
std::uint64_t cell_of(Ab color, float side) {
  const auto bits = [side](float value) {
    const float place = (side > 0 ? std::floor(value / side) : value) + 0.0f;  // -0 becomes 0, which it equals
    return std::uint64_t(std::bit_cast<std::uint32_t>(place));
  };
  return bits(color.a) << 32 | bits(color.b);
}

/// Smooths along what a guide shows as one: the guided filter (He et al. 2010, Eq. 5, 6 and 8), whose slopes and
/// offsets come from smaller images (He and Sun 2015, algorithm 2).
class GuidedFilter {
 public:
  GuidedFilter(cv::Mat guide, int radius) : guide_(std::move(guide)) {
    const int shrink = std::max(1, radius / kFilterRadius), side = 2 * (radius / shrink) + 1;
    size_ = {side, side};
    small_ = {std::max(1, guide_.cols / shrink), std::max(1, guide_.rows / shrink)};
    small_guide_ = shrunk(guide_);
    mean_ = around(small_guide_);
    variance_ = around(small_guide_.mul(small_guide_)) - mean_.mul(mean_) + kSmallContrast;
  }
  [[nodiscard]] cv::Mat operator()(const cv::Mat& values) const {
    const cv::Mat small = shrunk(values), mean = around(small);
    cv::Mat slope;
    cv::divide(around(small_guide_.mul(small)) - mean_.mul(mean), variance_, slope);
    const cv::Mat offset = mean - slope.mul(mean_);
    return enlarged(around(slope)).mul(guide_) + enlarged(around(offset));
  }

 private:
  [[nodiscard]] cv::Mat shrunk(const cv::Mat& values) const {
    cv::Mat small;
    cv::resize(values, small, small_, 0, 0, cv::INTER_AREA);
    return small;
  }
  [[nodiscard]] cv::Mat enlarged(const cv::Mat& small) const {
    cv::Mat values;
    cv::resize(small, values, guide_.size(), 0, 0, cv::INTER_LINEAR);
    return values;
  }
  [[nodiscard]] cv::Mat around(const cv::Mat& values) const {
    cv::Mat means;
    cv::blur(values, means, size_, cv::Point(-1, -1), cv::BORDER_REFLECT);
    return means;
  }

  cv::Size size_, small_;
  cv::Mat guide_, small_guide_, mean_, variance_;
};

/// The logarithm of distances, in units of kDepth. What shows no surface is far behind all that does.
cv::Mat depth_guide(const CachedView& view, std::span<const float> surface) {
  const float farthest = *std::ranges::max_element(surface);
  cv::Mat guide(view.height, view.width, CV_32F);
  std::ranges::transform(surface, guide.begin<float>(), [&](float distance) {
    return std::log(distance > 0 ? distance : std::max(farthest, 1.0f) * 10) / kDepth;
  });
  return guide;
}

cv::Mat lightness_guide(const CachedView& view) {
  cv::Mat guide(view.height, view.width, CV_32F);
  float* lightness = guide.ptr<float>();
  for (std::size_t p = 0; p < view.opacity.size(); ++p) lightness[p] = lightness_at(view, p) / kLightness;
  return guide;
}

}  // namespace

PixelLooks::PixelLooks(const CachedView& view, std::span<const float> of_view) : surface(of_view) {
  const std::size_t n = view.opacity.size();
  cv::Mat own(view.height, view.width, CV_32F), sums, squares;
  parallel_each(n, kPixelsPerPiece, [&](std::size_t p) { own.ptr<float>()[p] = lightness_at(view, p); });
  const cv::Size around(2 * kAround + 1, 2 * kAround + 1);
  const cv::Point middle(-1, -1);
  cv::boxFilter(own, sums, CV_32F, around, middle, false, cv::BORDER_CONSTANT);
  cv::sqrBoxFilter(own, squares, CV_32F, around, middle, false, cv::BORDER_CONSTANT);
  lightness.resize(n);
  texture.resize(n);
  const auto within = [](int at, int size) { return std::min(at + kAround, size - 1) - std::max(at - kAround, 0) + 1; };
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const auto p = std::size_t(y) * std::size_t(view.width) + std::size_t(x);
      const auto count = float(within(x, view.width) * within(y, view.height));
      lightness[p] = sums.ptr<float>()[p] / count;
      texture[p] = std::sqrt(std::max(squares.ptr<float>()[p] / count - lightness[p] * lightness[p], 0.0f));
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

std::array<float, Claims::kMost> Claims::shares() const {
  std::array<float, kMost> weights{};
  float all = 0;
  for (std::size_t i = 0; i < kMost && list[i].cost < kUnreached; ++i) {
    weights[i] = std::exp((list[0].cost - list[i].cost) / kShare);
    all += weights[i];
  }
  for (float& weight : weights) weight = all > 0 ? weight / all : 0;
  return weights;
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
  RunningColors near = strokes;
  std::vector<Claims> alike(claims_.size());
  const auto claim_by_likeness = [&](std::size_t p) {
    if (!strokes.is_known(p)) claim_alike(view_.camera.ray_of_pixel(p), looks, p, alike[p]);
  };
  // What runs does so on one thread: beside it, the others.
  parallel_tasks(2, [&](std::size_t task) {
    task == 0 ? run(near, view, surface) : parallel_each(alike.size(), kPixelsPerPiece, claim_by_likeness);
  });
  parallel_each(claims_.size(), kPixelsPerPiece, [&](std::size_t p) {
    if (near.is_known(p)) {
      const std::uint32_t color = number_of(near.ab[p]);  // none of those that run, where it was painted exactly
      claims_[p].add({near.cost[p], near.ab[p], color < lightness_.size() ? lightness_[color] : looks.lightness[p]});
    }
    for (const Claims::Claim& claim : alike[p].list) claims_[p].add(claim);
  });
}

/// Numbers them in the order in which they come. Each costs time at every pixel: where they are many, as in a painted
/// picture, those that lie near one another count as one.
void StrokesEverywhere::number_colors(std::span<const Ab> painted) {
  do {
    numbers_.clear();
    for (std::size_t i = 0; i < painted.size() && numbers_.size() <= kMostColors; ++i) {
      numbers_.try_emplace(cell_of(painted[i], cell_), std::uint32_t(numbers_.size()));
    }
    if (numbers_.size() > kMostColors) cell_ = std::max(2 * cell_, kSmallestCell);
  } while (numbers_.size() > kMostColors);
}

void StrokesEverywhere::take_samples(const RunningColors& strokes, const PixelLooks& looks) {
  std::vector<std::uint32_t> painted, color_of;
  std::vector<Ab> painted_colors;
  for (std::uint32_t p = 0; p < strokes.cost.size(); ++p) {
    if (!strokes.is_known(p) || strokes.reach[p] <= 0) continue;
    painted.push_back(p);
    painted_colors.push_back(strokes.ab[p]);
  }
  if (painted.empty()) return;
  number_colors(painted_colors);
  std::vector<std::size_t> count(numbers_.size());
  colors_.resize(count.size());
  lightness_.resize(count.size());
  reach_.resize(count.size());
  for (std::size_t i = 0; i < painted.size(); ++i) {
    const Ab color = painted_colors[i];
    const std::uint32_t c = color_of.emplace_back(number_of(color));
    ++count[c];
    colors_[c] = cell_ > 0 ? Ab{colors_[c].a + color.a, colors_[c].b + color.b} : color;
    lightness_[c] += looks.lightness[painted[i]];
    reach_[c] = std::max(reach_[c], strokes.reach[painted[i]]);
  }
  for (std::size_t c = 0; c < colors_.size(); ++c) {
    lightness_[c] /= float(count[c]);
    if (cell_ > 0) colors_[c] = {colors_[c].a / float(count[c]), colors_[c].b / float(count[c])};
  }
  take_samples_of(painted, color_of, count, looks);
}

/// @param painted   pixels
/// @param color_of  [painted] numbers of their colours
/// @param count     [colours] how many have it
void StrokesEverywhere::take_samples_of(std::span<const std::uint32_t> painted, std::span<const std::uint32_t> color_of,
                                        std::span<const std::size_t> count, const PixelLooks& looks) {
  const std::size_t each = std::max<std::size_t>(kMostSamples / colors_.size(), 1);
  room_ = (each + kSamplesAtOnce - 1) / kSamplesAtOnce * kSamplesAtOnce;
  for (auto* list : {&samples_.x, &samples_.y, &samples_.z, &samples_.log_distance, &samples_.texture}) {
    list->resize(colors_.size() * room_);
  }
  samples_.lightness.resize(colors_.size() * room_, kLikeNothing);
  std::vector<std::size_t> passed(colors_.size());
  sampled_.resize(colors_.size());
  for (std::size_t i = 0; i < painted.size(); ++i) {
    const std::uint32_t color = color_of[i], p = painted[i];
    const std::size_t every = (count[color] + each - 1) / each;
    if (passed[color]++ % every != every / 2) continue;
    const std::size_t to = color * room_ + sampled_[color]++;
    const Vec3f direction = view_.camera.ray_of_pixel(p).direction;
    samples_.x[to] = direction.x;
    samples_.y[to] = direction.y;
    samples_.z[to] = direction.z;
    samples_.log_distance[to] = looks.surface[p] > 0 ? std::log(looks.surface[p]) : 0;
    samples_.lightness[to] = looks.lightness[p];
    samples_.texture[to] = looks.texture[p];
  }
}

/// A pixel of any view, as the painted view would see it.
struct StrokesEverywhere::Looked {
  Vec3f direction;
  float log_distance = 0;
  bool is_solid = false;
  float lightness = 0, texture = 0;
};

/// Sum over samples; one that is in every way like the pixel counts 1.
/// @param per_angle  what an angle of 1 costs
CNERF_VECTOR_CLONES float StrokesEverywhere::likeness(const Samples& samples, std::size_t begin, std::size_t end,
                                                      const Looked& pixel, float per_angle) {
  std::array<float, kSamplesAtOnce> sums{};
  for (std::size_t first = begin; first < end; first += kSamplesAtOnce) {
    const float *x = &samples.x[first], *y = &samples.y[first], *z = &samples.z[first];
    const float* log_distance = &samples.log_distance[first];
    const float *lightness = &samples.lightness[first], *texture = &samples.texture[first];
    for (std::size_t i = 0; i < kSamplesAtOnce; ++i) {
      const float cosine = pixel.direction.x * x[i] + pixel.direction.y * y[i] + pixel.direction.z * z[i];
      const float angle = std::sqrt(std::max(2 - 2 * cosine, 0.0f));
      const float apart = std::abs(pixel.log_distance - log_distance[i]) * (1 / kDepth);
      const float depth = pixel.is_solid && log_distance[i] != 0 ? apart : kNoSurface;
      const float cost = angle * per_angle + depth + std::abs(pixel.lightness - lightness[i]) * (1 / kLightness) +
                         std::abs(pixel.texture - texture[i]) * (1 / kTexture);
      sums[i] += exp_of_negative(cost * (-1 / kSpread));
    }
  }
  return std::accumulate(sums.begin(), sums.end(), 0.0f);
}

void StrokesEverywhere::claim_alike(const Ray& ray, const PixelLooks& looks, std::size_t p, Claims& to) const {
  const bool is_solid = looks.surface[p] > 0;
  const Vec3f from = ray.at(is_solid ? looks.surface[p] : 1e3f) - view_.camera.origin.cast<float>();
  const float distance = length(from);
  const Looked pixel{from / distance, std::log(distance), is_solid, looks.lightness[p], looks.texture[p]};
  const float per_angle = float(view_.camera.intrinsics.fx) / (kPlane * float(view_.short_side()));
  for (std::size_t c = 0; c < colors_.size(); ++c) {
    const float alike = likeness(samples_, c * room_, (c + 1) * room_, pixel, per_angle);
    const float cost = -kSpread * std::log(alike / float(sampled_[c]));
    to.add({(kAlike + std::max(cost, 0.0f)) / reach_[c], colors_[c], lightness_[c]});
  }
}

/// Of a number that no colour has where it is none of them.
std::uint32_t StrokesEverywhere::number_of(Ab color) const {
  const auto found = numbers_.find(cell_of(color, cell_));
  return found != numbers_.end() ? found->second : std::uint32_t(colors_.size());
}

void smooth(std::span<Claims> claims, const CachedView& view, std::span<const float> surface) {
  std::vector<Claims::Claim> colors;  // of all pixels
  for (const Claims& pixel : claims) {
    if (colors.size() > kMostColors) return;
    for (const Claims::Claim& claim : pixel.list) {
      const auto is_it = [&](const Claims::Claim& other) { return same(other.color, claim.color); };
      const bool is_running = claim.cost > 0 && claim.cost < kUnreached;
      if (is_running && std::ranges::none_of(colors, is_it)) colors.push_back(claim);
    }
  }
  const int radius = std::max(1, int(std::lround(kSmoothRadius * float(view.short_side()))));
  const GuidedFilter along_surfaces(depth_guide(view, surface), radius);
  const GuidedFilter along_lightness(lightness_guide(view), radius);
  // There are not always more views than threads.
  const auto each_pixel = [&](const auto& work) { parallel_each(claims.size(), kPixelsPerPiece, work); };
  std::vector<std::array<float, Claims::kMost>> kept(claims.size());
  each_pixel([&](std::size_t p) { kept[p] = claims[p].shares(); });
  std::vector<Claims> smoothed(claims.size());
  const float most_cost = -kShare * std::log(kLeastShare);
  cv::Mat shares(view.height, view.width, CV_32F);
  for (const Claims::Claim& one : colors) {
    auto* const share = shares.ptr<float>();
    each_pixel([&](std::size_t p) {
      const auto of_color = std::ranges::find_if(
          claims[p].list, [&](const Claims::Claim& claim) { return same(claim.color, one.color); });
      share[p] = of_color != claims[p].list.end() ? kept[p][std::size_t(of_color - claims[p].list.begin())] : 0;
    });
    const cv::Mat smooth_shares = along_lightness(along_surfaces(shares));
    const auto* const smooth_share = smooth_shares.ptr<float>();
    each_pixel([&](std::size_t p) {
      const float own = std::min(smooth_share[p], 1.0f);
      const float cost = own > kLeastShare ? -kShare * std::log(own) : most_cost;  // most have none
      smoothed[p].add({claims[p].cost() + cost, one.color, one.lightness});
    });
  }
  each_pixel([&](std::size_t p) {
    if (claims[p].cost() > 0) claims[p] = smoothed[p];
  });
}

}  // namespace cnerf
