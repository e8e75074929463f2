#include "bake/color/point_color.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"

namespace cnerf::bake {
namespace {

constexpr std::array<Vec3f, 6> kAllSides{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};

bool in_gamut(Vec3f rgb, float luminance) {
  const float top = std::max(1.0f, luminance);
  for (int channel = 0; channel < 3; ++channel) {
    if (rgb[channel] < 0 || rgb[channel] > top) return false;
  }
  return true;
}

}  // namespace

VoxelColor voxel_color(float luminance, Chromaticity chromaticity, float gain) {
  if (chromaticity.x == 1 && chromaticity.z == 1) return {{luminance, luminance, luminance}, 0, 0};
  const float light = luminance / gain;
  VoxelColor color;
  color.rgb = linear_rgb_from_relative_xyz(Vec3f{light * chromaticity.x, light, light * chromaticity.z});
  if (!in_gamut(color.rgb, light)) {
    color.rgb = gamut_mapped_linear_rgb_from_lab(lab_from_linear_rgb(color.rgb));
  }
  color.rgb *= gain;
  const Lab<float> lab = lab_from_linear_rgb(color.rgb);
  color.a = lab.a;
  color.b = lab.b;
  return color;
}

std::vector<Chromaticity> chromaticity_of(const ColorField& field, std::span<const Vec3f> points) {
  std::vector<Chromaticity> answers(points.size());
  parallel_ranges(points.size(), field.points_at_a_time(), [&](std::size_t begin, std::size_t end) {
    field.query_chromaticity(points.subspan(begin, end - begin), std::span(answers).subspan(begin, end - begin));
  });
  for (const Chromaticity& c : answers) {
    CNERF_CHECK(std::isfinite(c.x) && std::isfinite(c.z), "the field answered a chromaticity that is not finite");
  }
  return answers;
}

void ViewMeans::look_along(Vec3f unit, Vec3f direction, float weight) {
  positions_.push_back(unit);
  directions_.push_back(direction);
  weights_.push_back(weight);
}

void ViewMeans::look_from_all_sides(Vec3f unit) {
  for (const Vec3f direction : kAllSides) look_along(unit, direction, 1.0f);
}

void ViewMeans::append(const ViewMeans& others) {
  const std::size_t first = positions_.size();
  positions_.insert(positions_.end(), others.positions_.begin(), others.positions_.end());
  directions_.insert(directions_.end(), others.directions_.begin(), others.directions_.end());
  weights_.insert(weights_.end(), others.weights_.begin(), others.weights_.end());
  for (const std::size_t end : others.ends_) ends_.push_back(first + end);
}

std::vector<float> ViewMeans::luminance(const ColorField& field) const {
  std::vector<float> answers(positions_.size());
  const std::span<const Vec3f> positions = positions_, directions = directions_;
  parallel_ranges(answers.size(), field.points_at_a_time(), [&](std::size_t begin, std::size_t end) {
    const std::size_t count = end - begin;
    field.query_luminance(positions.subspan(begin, count), directions.subspan(begin, count),
                          std::span(answers).subspan(begin, count));
  });
  std::vector<float> means;
  std::size_t begin = 0;
  for (const std::size_t end : ends_) {
    double sum = 0, weight = 0;
    for (std::size_t q = begin; q < end; ++q) {
      CNERF_CHECK(std::isfinite(answers[q]), "the field answered a luminance that is not finite");
      sum += double(weights_[q]) * answers[q];
      weight += weights_[q];
    }
    means.push_back(float(std::max(0.0, sum / weight)));
    begin = end;
  }
  return means;
}

}  // namespace cnerf::bake
