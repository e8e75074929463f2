#pragma once
/// A field given by formulas, and cameras to look at it with.

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "bake/camera.h"
#include "src/field/color_field.h"

namespace cnerf::bake::test {

/// Which cells of the unit box lie at places where a density is not zero, NaN included: looked up once, as a trained
/// field has it.
class Occupancy {
 public:
  explicit Occupancy(std::function<float(Vec3f)> density) : density_(std::move(density)) {}

  [[nodiscard]] bool at(Vec3f position) {
    std::call_once(once_, [&] { look(); });
    const auto cell = [](float x) { return std::clamp(int(x * kCells), 0, kCells - 1); };
    return is_occupied_[std::size_t((cell(position.z) * kCells + cell(position.y)) * kCells + cell(position.x))];
  }

 private:
  static constexpr int kCells = 128, kCorners = kCells + 1;

  void look() {
    is_occupied_.assign(std::size_t(kCells) * kCells * kCells, false);
    for (int z = 0; z < kCorners; ++z) {
      for (int y = 0; y < kCorners; ++y) {
        for (int x = 0; x < kCorners; ++x) {
          if (density_(Vec3f{float(x), float(y), float(z)} / float(kCells)) != 0) mark_around(x, y, z);
        }
      }
    }
  }
  void mark_around(int x, int y, int z) {
    for (int k = std::max(z - 2, 0); k < std::min(z + 2, kCells); ++k) {
      for (int j = std::max(y - 2, 0); j < std::min(y + 2, kCells); ++j) {
        for (int i = std::max(x - 2, 0); i < std::min(x + 2, kCells); ++i) {
          is_occupied_[std::size_t((k * kCells + j) * kCells + i)] = true;
        }
      }
    }
  }

  std::function<float(Vec3f)> density_;
  std::once_flag once_;
  std::vector<bool> is_occupied_;
};

/// Everything in unit space. Occupied wherever density may be positive within 1/128.
class AnalyticField : public ColorField {
 public:
  using Density = std::function<float(Vec3f)>;
  using Luminance = std::function<float(Vec3f, Vec3f)>;

  AnalyticField(SceneFrame frame, Density density, float luminance = 0.5f, Chromaticity chromaticity = {})
      : frame_(frame),
        density_(std::move(density)),
        luminance_([luminance](Vec3f, Vec3f) { return luminance; }),
        chromaticity_([chromaticity](Vec3f) { return chromaticity; }) {}

  AnalyticField& with_luminance(Luminance luminance) {
    luminance_ = std::move(luminance);
    return *this;
  }
  AnalyticField& with_chromaticity(std::function<Chromaticity(Vec3f)> chromaticity) {
    chromaticity_ = std::move(chromaticity);
    return *this;
  }

  [[nodiscard]] const SceneFrame& frame() const override { return frame_; }
  [[nodiscard]] bool may_be_occupied(Vec3f position) const override { return occupancy_->at(position); }
  void query_density(std::span<const Vec3f> positions, std::span<float> sigma) const override {
    for (std::size_t i = 0; i < positions.size(); ++i) sigma[i] = density_(positions[i]);
  }
  void query_luminance(std::span<const Vec3f> positions, std::span<const Vec3f> directions,
                       std::span<float> luminance) const override {
    for (std::size_t i = 0; i < positions.size(); ++i) luminance[i] = luminance_(positions[i], directions[i]);
  }
  void query_chromaticity(std::span<const Vec3f> positions, std::span<Chromaticity> chromaticity) const override {
    for (std::size_t i = 0; i < positions.size(); ++i) chromaticity[i] = chromaticity_(positions[i]);
  }

 private:
  SceneFrame frame_;
  Density density_;
  std::shared_ptr<Occupancy> occupancy_ = std::make_shared<Occupancy>(density_);
  Luminance luminance_;
  std::function<Chromaticity(Vec3f)> chromaticity_;
};

/// Density `sigma` inside a box of unit space.
inline AnalyticField::Density box_density(Vec3f min, Vec3f max, float sigma) {
  return [=](Vec3f p) { return Aabbf{min, max}.contains(p) ? sigma : 0.0f; };
}
/// Density `sigma` inside a sphere of unit space.
inline AnalyticField::Density sphere_density(Vec3f centre, float radius, float sigma) {
  return [=](Vec3f p) { return length(p - centre) < radius ? sigma : 0.0f; };
}

/// A pinhole camera at `eye` that looks at `target`; `focal` in pixels, principal point in the middle.
inline Camera camera_at(const std::string& name, Vec3d eye, Vec3d target, int width, int height, double focal) {
  const Vec3d forward = normalized(target - eye);
  const Vec3d up = std::abs(forward.z) < 0.9 ? Vec3d{0, 0, 1} : Vec3d{0, 1, 0};
  const Vec3d right = normalized(cross(forward, up));
  Camera camera;
  camera.name = name;
  camera.intrinsics.width = width;
  camera.intrinsics.height = height;
  camera.intrinsics.fx = camera.intrinsics.fy = focal;
  camera.intrinsics.cx = width / 2.0;
  camera.intrinsics.cy = height / 2.0;
  camera.world_from_camera = {Mat3d::from_columns(right, cross(forward, right), forward), eye};
  return camera;
}

}  // namespace cnerf::bake::test
