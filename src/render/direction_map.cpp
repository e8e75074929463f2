#include "src/render/direction_map.h"

#include <algorithm>

#include "src/base/check.h"

namespace cnerf {
namespace {

/// A level of the pyramid: sums and weights, [H, W, channels + 1].
struct Level {
  int width = 0, height = 0, stride = 0;
  std::vector<float> sums;

  [[nodiscard]] float* at(int x, int y) {
    return sums.data() + (std::size_t(y) * std::size_t(width) + std::size_t((x + width) % width)) * std::size_t(stride);
  }
};

/// Four pixels become one; a pixel that knows enough counts no more than another.
Level pulled(Level& fine) {
  Level coarse{fine.width / 2, std::max(fine.height / 2, 1), fine.stride, {}};
  coarse.sums.resize(std::size_t(coarse.width) * std::size_t(coarse.height) * std::size_t(coarse.stride), 0.0f);
  for (int y = 0; y < fine.height; ++y) {
    for (int x = 0; x < fine.width; ++x) {
      const float* from = fine.at(x, y);
      const float weight = from[fine.stride - 1], share = weight > 1 ? 1 / weight : 1.0f;
      float* to = coarse.at(x / 2, std::min(y / 2, coarse.height - 1));
      for (int c = 0; c < fine.stride; ++c) to[c] += share * from[c];
    }
  }
  return coarse;
}

/// Pixels that know little get what the coarser level has there.
void push(Level& coarse, Level& fine) {
  for (int y = 0; y < fine.height; ++y) {
    for (int x = 0; x < fine.width; ++x) {
      float* to = fine.at(x, y);
      const float weight = to[fine.stride - 1], missing = 1 - weight;
      if (missing <= 0) continue;
      const SkyPlace place{(float(x) + 0.5f) / float(fine.width), 1 - (float(y) + 0.5f) / float(fine.height)};
      SkyCorners(place, coarse.width, coarse.height).for_each(coarse.width, [&](int pixel, float share) {
        const float* from = coarse.sums.data() + std::size_t(pixel) * std::size_t(coarse.stride);
        for (int c = 0; c + 1 < fine.stride; ++c) to[c] += missing * share * from[c] / from[fine.stride - 1];
      });
      to[fine.stride - 1] = 1;
    }
  }
}

}  // namespace

DirectionSums::DirectionSums(int width, int channels)
    : width_(width),
      channels_(channels),
      sums_(std::size_t(width) * std::size_t(width / 2) * std::size_t(channels + 1), 0.0f) {
  CNERF_CHECK(width >= 2 && (width & (width - 1)) == 0, "a power of two");
}

bool DirectionSums::is_empty() const {
  const auto stride = std::size_t(channels_ + 1);
  for (std::size_t p = stride - 1; p < sums_.size(); p += stride) {
    if (sums_[p] > 0) return false;
  }
  return true;
}

void DirectionSums::add(Vec3f direction, std::span<const float> values, float weight) {
  SkyCorners(sky_place(direction), width(), height()).for_each(width(), [&](int pixel, float share) {
    float* sums = sums_.data() + std::size_t(pixel) * std::size_t(channels_ + 1);
    for (int c = 0; c < channels_; ++c) sums[c] += share * weight * values[std::size_t(c)];
    sums[channels_] += share * weight;
  });
}

DirectionMap DirectionSums::filled() const {
  CNERF_CHECK(!is_empty(), "something is known");
  std::vector<Level> levels{{width(), height(), channels_ + 1, sums_}};
  while (levels.back().width > 1) levels.push_back(pulled(levels.back()));
  for (std::size_t l = levels.size() - 1; l-- > 0;) push(levels[l + 1], levels[l]);
  DirectionMap map{width(), height(), {}};
  for (int c = 0; c < channels_; ++c) {
    std::vector<float>& plane = map.planes.emplace_back();
    for (std::size_t p = 0; p < levels[0].sums.size(); p += std::size_t(channels_ + 1)) {
      plane.push_back(levels[0].sums[p + std::size_t(c)] / levels[0].sums[p + std::size_t(channels_)]);
    }
  }
  return map;
}

}  // namespace cnerf
