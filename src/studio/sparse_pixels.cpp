#include "src/studio/sparse_pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>

#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"
#include "src/picture/joint_upsampling.h"

namespace cnerf::studio {
namespace {

constexpr std::size_t kGrain = 1024;             // pixels of a parallel piece of work
constexpr std::size_t kForetoldGrain = 1 << 13;  // of one that lists pixels
constexpr int kColorStep = 2;                    // between pixels that have colours

// Measured on nine views of three captures, 1280 x 720: with these 15 to 34 % of the rays are traced, and pictures are
// at least 45.7 dB from those of `cnerf render`; whole ones are 50 from them.
constexpr float kSameLightness = 8;  // most that L* of the pixels around may differ
constexpr float kSameColor = 8;      // likewise a and b
constexpr float kDoubt = 1.4f;       // most that foretelling by other rules may change L* ...
constexpr float kCoarseDoubt = 1;    // ... and of pixels that others are foretold from

/// Smallest and largest of some numbers.
struct Range {
  float least, most;
  explicit Range(float value) : least(value), most(value) {}
  void add(float value) {
    least = std::min(least, value);
    most = std::max(most, value);
  }
  [[nodiscard]] float width() const { return most - least; }
};

/// What a pixel's neighbours say of it.
struct Foretold {
  float value = 0;
  float doubt = 0;  ///< how far other rules are from it
};

/// A cubic through the four nearest pixels of each axis, and how far it is from a straight line, and one axis from the
/// other: where there is a ridge or an edge.
Foretold foretold(std::array<float, 2> near, std::array<float, 2> far) {
  const std::array<float, 2> bend = {(near[0] - far[0]) / 8, (near[1] - far[1]) / 8};
  return {(near[0] + bend[0] + near[1] + bend[1]) / 2,
          std::max({std::abs(bend[0]), std::abs(bend[1]), std::abs(near[0] - near[1])})};
}

}  // namespace

SparsePixels::SparsePixels(int width, int height, int lattice, std::size_t sides)
    : width_(width), height_(height), lattice_(lattice), lightness_(std::size_t(width) * std::size_t(height)) {
  CNERF_CHECK(lattice > 0 && (lattice & (lattice - 1)) == 0, "a lattice's step is a power of two");
  const std::size_t count = std::size_t(width) * std::size_t(height);
  for (std::size_t s = 0; s < sides; ++s) colors_.push_back({Plane(count), Plane(count)});
  passes_.push_back({});
  for (int reach = lattice / 2; reach > 0; reach /= 2) {
    // The lattice has the middles of its squares, so that upright lines cannot slip through it.
    if (2 * reach < lattice) passes_.push_back({reach, true, reach >= kColorStep});
    passes_.push_back({reach, false, reach >= kColorStep});
  }
}

SparsePixels::Columns SparsePixels::columns_of(const Pass& pass, int row) const {
  const Columns none = {width_, 1};
  if (pass.reach == 0) {
    if (row % lattice_ == 0) return {0, lattice_};
    return lattice_ > 1 && row % lattice_ == lattice_ / 2 ? Columns{lattice_ / 2, lattice_} : none;
  }
  if (row % pass.reach != 0) return none;
  const bool is_between = row / pass.reach % 2 != 0;  // lines of pixels that were known before
  if (pass.is_diagonal) return is_between ? Columns{pass.reach, 2 * pass.reach} : none;
  return {is_between ? 0 : pass.reach, 2 * pass.reach};
}

std::vector<std::size_t> SparsePixels::foretell(std::size_t pass) {
  const Pass& of = passes_[pass];
  const std::size_t rows = std::max<std::size_t>(1, kForetoldGrain / std::size_t(width_));
  std::vector<std::vector<std::size_t>> of_pieces((std::size_t(height_) + rows - 1) / rows);
  parallel_ranges(std::size_t(height_), rows, [&](std::size_t begin, std::size_t end) {
    std::vector<std::size_t>& wanted = of_pieces[begin / rows];
    for (std::size_t y = begin; y < end; ++y) {
      const Columns columns = columns_of(of, int(y));
      for (int x = columns.first; x < width_; x += columns.step) {
        if (!foretell_pixel(of, x, int(y))) wanted.push_back(y * std::size_t(width_) + std::size_t(x));
      }
    }
  });
  std::vector<std::size_t> wanted;
  wanted.reserve(std::transform_reduce(of_pieces.begin(), of_pieces.end(), std::size_t(0), std::plus<>(),
                                       [](const auto& piece) { return piece.size(); }));
  for (const auto& piece : of_pieces) wanted.insert(wanted.end(), piece.begin(), piece.end());
  return wanted;
}

bool SparsePixels::foretell_pixel(const Pass& pass, int column, int row) {
  const auto has = [&](int steps) {
    const int d = steps * pass.reach;
    return column - d >= 0 && column + d < width_ && row - d >= 0 && row + d < height_;
  };
  if (pass.reach == 0 || !has(1)) return false;
  const std::ptrdiff_t along_row = pass.reach, along_column = std::ptrdiff_t(pass.reach) * width_;
  const std::array<std::ptrdiff_t, 2> axes = pass.is_diagonal
                                                 ? std::array{along_column + along_row, along_column - along_row}
                                                 : std::array{along_row, along_column};
  const std::size_t pixel = std::size_t(row) * std::size_t(width_) + std::size_t(column);
  float* const light = lightness_.at(pixel);
  const std::ptrdiff_t far_steps = has(3) ? 3 : 1;

  Range range(light[axes[0]]);
  std::array<float, 2> near, far;
  for (std::size_t a = 0; a < 2; ++a) {
    const float before = light[-axes[a]], behind = light[axes[a]];
    range.add(before);
    range.add(behind);
    near[a] = (before + behind) / 2;
    far[a] = (light[-far_steps * axes[a]] + light[far_steps * axes[a]]) / 2;
  }
  const Foretold foretold_light = foretold(near, far);
  const bool is_coarse = pass.reach >= kColorStep;
  if (range.width() > kSameLightness || foretold_light.doubt > (is_coarse ? kCoarseDoubt : kDoubt)) return false;
  if (pass.has_colors && !foretell_colors(pixel, axes)) return false;
  *light = std::max(foretold_light.value, 0.0f);
  return true;
}

bool SparsePixels::foretell_colors(std::size_t pixel, const std::array<std::ptrdiff_t, 2>& axes) {
  for (Colors& colors : colors_) {
    for (Plane& plane : colors) {
      float* const value = plane.at(pixel);
      Range range(value[axes[0]]);
      float sum = 0;
      for (const std::ptrdiff_t step : {-axes[0], axes[0], -axes[1], axes[1]}) {
        range.add(value[step]);
        sum += value[step];
      }
      if (range.width() > kSameColor) return false;
      *value = sum / 4;
    }
  }
  return true;
}

void SparsePixels::set_light(std::span<const std::size_t> pixels, std::span<const float> luminance) {
  CNERF_CHECK_EQ(pixels.size(), luminance.size());
  parallel_each(pixels.size(), kGrain,
                [&](std::size_t i) { *lightness_.at(pixels[i]) = lightness_from_luminance(luminance[i]); });
}

void SparsePixels::set_colors(std::size_t side, std::span<const std::size_t> pixels, std::span<const Ab> colors) {
  CNERF_CHECK_EQ(pixels.size(), colors.size());
  Plane &a = colors_[side][0], &b = colors_[side][1];
  parallel_each(pixels.size(), kGrain, [&](std::size_t i) {
    *a.at(pixels[i]) = colors[i].a;
    *b.at(pixels[i]) = colors[i].b;
  });
}

void SparsePixels::spread_colors() {
  if (lattice_ < kColorStep || colors_.empty()) return;
  parallel_each(std::size_t(height_), std::max<std::size_t>(1, kGrain / std::size_t(width_)), [&](std::size_t y) {
    const bool is_known = y % kColorStep == 0;
    for (int x = is_known ? 1 : 0; x < width_; x += is_known ? kColorStep : 1) spread_to(x, int(y));
  });
}

void SparsePixels::spread_to(int column, int row) {
  std::array<std::size_t, 4> from;
  std::array<float, 4> weights;
  std::size_t count = 0;
  float total = 0;
  const auto at = [&](int x, int y) { return std::size_t(y) * std::size_t(width_) + std::size_t(x); };
  for (int y = row - row % kColorStep; y <= row + row % kColorStep && y < height_; y += kColorStep) {
    for (int x = column - column % kColorStep; x <= column + column % kColorStep && x < width_; x += kColorStep) {
      from[count] = at(x, y);
      weights[count] = likeness_by_lightness(*lightness_.at(from[count]) - *lightness_.at(at(column, row)));
      total += weights[count++];
    }
  }
  for (Colors& colors : colors_) {
    for (Plane& plane : colors) {
      float mean = 0;
      for (std::size_t i = 0; i < count; ++i) mean += weights[i] / total * *plane.at(from[i]);
      *plane.at(at(column, row)) = mean;
    }
  }
}

}  // namespace cnerf::studio
