#pragma once
/// Numbers by direction alone, as what is far beyond the box has them: an equirectangular picture that is read between
/// its pixels, and how one is made of what views see.

#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <vector>

#include "src/base/host_device.h"
#include "src/base/vec3.h"

namespace cnerf {

/// A place in the picture, both in [0, 1]: u to the right as seen from inside, v from straight down (-z) to straight up
/// (+z), u = 0.5 towards +x. This is how Blender lays environment textures out.
struct SkyPlace {
  float u = 0, v = 0;
};

/// @param direction  unit length, the axes of unit space, which are the world's
[[nodiscard]] CNERF_HD inline SkyPlace sky_place(Vec3f direction) {
  constexpr float kPi = std::numbers::pi_v<float>;
  const float across = std::sqrt(direction.x * direction.x + direction.y * direction.y);
  return {0.5f - std::atan2(direction.y, direction.x) / (2 * kPi), 0.5f + std::atan2(direction.z, across) / kPi};
}
[[nodiscard]] inline Vec3f sky_direction(SkyPlace place) {
  constexpr float kPi = std::numbers::pi_v<float>;
  const float azimuth = (0.5f - place.u) * 2 * kPi, elevation = (place.v - 0.5f) * kPi;
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), std::sin(elevation)};
}

/// The four pixels around a place, and their shares.
struct SkyCorners {
  int column[2] = {}, row[2] = {};
  float right = 0, down = 0;  ///< shares of the second column and row

  CNERF_HD SkyCorners(SkyPlace place, int width, int height) {
    const float x = place.u * float(width) - 0.5f, y = (1 - place.v) * float(height) - 0.5f;
    const float left = std::floor(x), top = std::floor(y);
    right = x - left;
    down = y - top;
    for (int i = 0; i < 2; ++i) {
      column[i] = (int(left) + i + width) % width;
      const int at = int(top) + i;
      row[i] = at < 0 ? 0 : at >= height ? height - 1 : at;
    }
  }
  /// @param visit  (pixel, share)
  template <typename Visit>
  CNERF_HD void for_each(int width, Visit&& visit) const {
    for (int j = 0; j < 2; ++j) {
      for (int i = 0; i < 2; ++i) {
        visit(row[j] * width + column[i], (i == 0 ? 1 - right : right) * (j == 0 ? 1 - down : down));
      }
    }
  }
};

/// One number per pixel, in memory of either device.
struct DirectionView {
  const float* values = nullptr;  ///< [H, W], the top row first; null: there is no such picture
  int width = 0, height = 0;

  [[nodiscard]] CNERF_HD float along(Vec3f direction) const {
    float value = 0;
    SkyCorners(sky_place(direction), width, height).for_each(width, [&](int pixel, float share) {
      value += share * values[pixel];
    });
    return value;
  }
};

struct DirectionMap {
  int width = 0, height = 0;               ///< 0: there is none
  std::vector<std::vector<float>> planes;  ///< [channels], each [H, W]

  [[nodiscard]] bool exists() const { return width > 0; }
  [[nodiscard]] DirectionView plane(std::size_t channel) const { return {planes[channel].data(), width, height}; }
};

/// Weighted sums by direction, of which a map is made.
class DirectionSums {
 public:
  DirectionSums() = default;
  /// @param width  pixels, a power of two; the height is half of it
  DirectionSums(int width, int channels);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return width_ / 2; }
  [[nodiscard]] bool is_empty() const;
  /// @param values  [channels]
  void add(Vec3f direction, std::span<const float> values, float weight);
  /// The means; where nothing was added, what is around goes on smoothly (pull and push, Gortler et al. 1996).
  [[nodiscard]] DirectionMap filled() const;
  /// [H, W, channels + 1], the weights last.
  [[nodiscard]] std::vector<float>& sums() { return sums_; }

 private:
  int width_ = 0, channels_ = 0;
  std::vector<float> sums_;
};

}  // namespace cnerf
