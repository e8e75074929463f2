#include "src/prepare/image_pairs.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <set>

#include "src/prepare/grey_image.h"

namespace cnerf::prepare {
namespace {

constexpr int kGrid = 4, kDirections = 8;

float likeness(const LookVector& a, const LookVector& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0f);
}

void add(std::set<std::pair<int, int>>& pairs, int i, int j, int count) {
  if (j >= 0 && j < count && i != j) pairs.insert(std::minmax(i, j));
}

}  // namespace

LookVector look_of(const cv::Mat1b& picture) {
  cv::Mat1b small;
  cv::resize(reduced_to(picture, 128), small, {64, 64}, 0, 0, cv::INTER_AREA);
  cv::Mat1f dx, dy;
  cv::Sobel(small, dx, CV_32F, 1, 0);
  cv::Sobel(small, dy, CV_32F, 0, 1);
  LookVector look(kGrid * kGrid * kDirections);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      const float turn = std::atan2(dy(y, x), dx(y, x)) / float(2 * CV_PI) + 0.5f;
      const int direction = std::min(kDirections - 1, int(turn * kDirections));
      const int cell = y * kGrid / 64 * kGrid + x * kGrid / 64;
      look[std::size_t(cell * kDirections + direction)] += std::hypot(dx(y, x), dy(y, x));
    }
  }
  for (float& value : look) value = std::sqrt(value);  // a few strong edges should not decide alone
  const float norm = std::sqrt(likeness(look, look));
  for (float& value : look) value /= std::max(norm, 1e-9f);
  return look;
}

std::vector<std::pair<int, int>> choose_pairs(const std::vector<LookVector>& looks, const PairOptions& options) {
  const int count = int(looks.size());
  std::set<std::pair<int, int>> pairs;
  for (int i = 0; i < count; ++i) {
    for (int step = 1; step <= options.neighbours; ++step) add(pairs, i, i + step, count);
    for (int step = 16; step < count; step *= 2) add(pairs, i, i + step, count);
    std::vector<std::pair<float, int>> others;
    for (int j = 0; j < count; ++j) {
      if (j != i) others.emplace_back(-likeness(looks[std::size_t(i)], looks[std::size_t(j)]), j);
    }
    std::ranges::sort(others);
    const auto alike = std::min(others.size(), std::size_t(options.alike));
    for (std::size_t k = 0; k < alike; ++k) add(pairs, i, others[k].second, count);
  }
  return {pairs.begin(), pairs.end()};
}

}  // namespace cnerf::prepare
