#include "bake/mesh/uv/atlas.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <string>

#include "src/base/error.h"

namespace cnerf::bake {
namespace {

struct Box2 {
  Point2 min{std::numeric_limits<float>::max(), std::numeric_limits<float>::max()};
  Point2 max{std::numeric_limits<float>::lowest(), std::numeric_limits<float>::lowest()};

  void grow(Point2 p) {
    min = {std::min(min.x, p.x), std::min(min.y, p.y)};
    max = {std::max(max.x, p.x), std::max(max.y, p.y)};
  }
  [[nodiscard]] Point2 size() const { return max - min; }
};

/// A chart turned upright, y downwards, with its box at the origin.
struct UprightChart {
  Point2 axis;
  Point2 corner;  ///< what was subtracted
  Point2 size;
  std::vector<PlanarTriangle> triangles;
};

Point2 turned_down(Point2 axis, Point2 p) {
  return {axis.x * p.x - axis.y * p.y, -(axis.y * p.x + axis.x * p.y)};
}

/// Turned so that its box is smallest and lies: low charts leave an even skyline.
UprightChart upright(const std::vector<PlanarTriangle>& triangles) {
  constexpr int kAngles = 36;
  UprightChart best;
  float best_area = std::numeric_limits<float>::max();
  for (int step = 0; step < 2 * kAngles; ++step) {
    const float angle = std::numbers::pi_v<float> / 2 * float(step) / kAngles;
    const Point2 axis{std::cos(angle), std::sin(angle)};
    Box2 box;
    for (const PlanarTriangle& t : triangles) {
      for (const Point2 p : t) box.grow(turned_down(axis, p));
    }
    const Point2 size = box.size();
    if (size.x < size.y || size.x * size.y >= best_area) continue;
    best_area = size.x * size.y;
    best = {axis, box.min, size, {}};
  }
  for (PlanarTriangle t : triangles) {
    for (Point2& p : t) p = turned_down(best.axis, p) - best.corner;
    best.triangles.push_back(t);
  }
  return best;
}

/// What a chart covers in every column of texels, gutter included; rows, upper inclusive, lower exclusive.
struct Outline {
  std::vector<int> upper, lower;

  [[nodiscard]] int width() const { return int(upper.size()); }
};

Outline outline_of(const UprightChart& chart, float scale, int gutter) {
  const int columns = int(std::floor(chart.size.x * scale)) + 1;
  std::vector<int> upper(columns, std::numeric_limits<int>::max()), lower(columns, std::numeric_limits<int>::min());
  for (const PlanarTriangle& t : chart.triangles) {
    for (int corner = 0; corner < 3; ++corner) {
      Point2 a = t[corner] * scale, b = t[(corner + 1) % 3] * scale;
      if (a.x > b.x) std::swap(a, b);
      const int first = std::clamp(int(std::floor(a.x)), 0, columns - 1);
      const int last = std::clamp(int(std::floor(b.x)), 0, columns - 1);
      for (int column = first; column <= last; ++column) {
        const auto y_at = [&](float x) { return b.x > a.x ? a.y + (b.y - a.y) * (x - a.x) / (b.x - a.x) : a.y; };
        const float left = y_at(std::max(a.x, float(column)));
        const float right = b.x > a.x ? y_at(std::min(b.x, float(column + 1))) : b.y;
        upper[column] = std::min(upper[column], int(std::floor(std::min(left, right))));
        lower[column] = std::max(lower[column], int(std::floor(std::max(left, right))) + 1);
      }
    }
  }
  Outline outline{std::vector<int>(columns + 2 * gutter, std::numeric_limits<int>::max()),
                  std::vector<int>(columns + 2 * gutter, std::numeric_limits<int>::min())};
  for (int column = 0; column < columns; ++column) {
    if (upper[column] > lower[column]) continue;  // between pieces of a chart
    for (int reach = column; reach <= column + 2 * gutter; ++reach) {
      outline.upper[reach] = std::min(outline.upper[reach], upper[column]);  // rows shift by the gutter: upper - gutter
      outline.lower[reach] = std::max(outline.lower[reach], lower[column] + 2 * gutter);
    }
  }
  return outline;
}

/// Rows from the top that are taken, column by column.
class Skyline {
 public:
  explicit Skyline(int size) : taken_(std::size_t(size), 0) {}

  /// Upper left texel, gutter included, of the place where the outline leaves the smallest gap; nothing when it does
  /// not fit.
  [[nodiscard]] std::optional<std::pair<int, int>> place(const Outline& outline) {
    const int size = int(taken_.size());
    const int stride = std::max(1, size / 512);
    std::optional<std::pair<int, int>> best;
    long least = std::numeric_limits<long>::max();
    for (int x = 0; x + outline.width() <= size; x += stride) {
      const int y = lowest_row(outline, x);
      long gap = 0;
      int bottom = 0;
      for (int c = 0; c < outline.width(); ++c) {
        if (outline.upper[c] > outline.lower[c]) continue;
        gap += y + outline.upper[c] - taken_[x + c];
        bottom = std::max(bottom, y + outline.lower[c]);
      }
      if (bottom > size) continue;
      // High up first, or charts would be stacked where they match best; small gaps among those.
      const long cost = long(bottom) * outline.width() + gap;
      if (cost >= least) continue;
      least = cost;
      best = {x, y};
    }
    if (best) take(outline, best->first, best->second);
    return best;
  }

 private:
  [[nodiscard]] int lowest_row(const Outline& outline, int x) const {
    int y = 0;
    for (int c = 0; c < outline.width(); ++c) {
      if (outline.upper[c] <= outline.lower[c]) y = std::max(y, taken_[x + c] - outline.upper[c]);
    }
    return y;
  }
  void take(const Outline& outline, int x, int y) {
    for (int c = 0; c < outline.width(); ++c) {
      if (outline.upper[c] > outline.lower[c]) continue;
      taken_[x + c] = y + outline.lower[c];
    }
  }

  std::vector<int> taken_;
};

std::optional<Atlas> packed_at(float scale, const std::vector<UprightChart>& charts,
                               const std::vector<std::size_t>& order, int size, int gutter) {
  Skyline skyline(size);
  Atlas atlas;
  atlas.texels_per_unit = scale;
  atlas.placements.resize(charts.size());
  for (const std::size_t c : order) {
    if (charts[c].size.x * scale > float(size)) return std::nullopt;
    const auto place = skyline.place(outline_of(charts[c], scale, gutter));
    if (!place) return std::nullopt;
    const Point2 corner{float(place->first + gutter), float(place->second + gutter)};
    atlas.placements[c] = {charts[c].axis, corner - charts[c].corner * scale};
  }
  return atlas;
}

}  // namespace

Atlas pack_charts(const std::vector<std::vector<PlanarTriangle>>& charts, int size, int gutter) {
  std::vector<UprightChart> upright_charts;
  double area = 0;
  for (const auto& chart : charts) {
    upright_charts.push_back(upright(chart));
    for (const PlanarTriangle& t : chart) area += std::abs(signed_area(t)) / 2;
  }
  std::vector<std::size_t> order(charts.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](auto a, auto b) { return upright_charts[a].size.y > upright_charts[b].size.y; });

  constexpr int kSteps = 9;
  auto high = float(size / std::sqrt(std::max(area, 1e-12)));  // every texel used
  float low = 0;
  std::optional<Atlas> best;
  for (int step = 0; step < kSteps || (!best && step < 2 * kSteps); ++step) {
    const float middle = step == 0 ? 0.7f * high : 0.5f * (low + high);
    if (auto atlas = packed_at(middle, upright_charts, order, size, gutter)) {
      best = std::move(atlas);
      low = middle;
    } else {
      high = middle;
    }
  }
  if (!best) {
    throw UsageError("texture_size: " + std::to_string(size) + " texels hold no atlas of " +
                     std::to_string(charts.size()) + " charts; enlarge it, or take fewer faces");
  }
  return *best;
}

}  // namespace cnerf::bake
