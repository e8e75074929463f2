#pragma once
/// A tiny capture made in memory: cameras on a circle, images of smooth random shading. Nothing to reconstruct well,
/// all that is needed to compare gradients and repeat runs.

#include <cmath>
#include <numbers>

#include "src/capture/capture.h"
#include "src/render/training_views.h"

namespace cnerf::test {

inline Affined look_at(Vec3d eye, Vec3d target) {
  const Vec3d forward = normalized(target - eye);
  const Vec3d right = normalized(cross(forward, Vec3d{0, 0, 1}));
  return {Mat3d::from_columns(right, cross(forward, right), forward), eye};
}

/// A sky that a quarter of the pixels show, and half of them perhaps; brighter towards +x.
class ToySky {
 public:
  ToySky(std::size_t views, std::size_t pixels) : labels_(views, std::vector<SkyLabel>(pixels)) {
    for (std::size_t v = 0; v < views; ++v) {
      for (std::size_t p = 0; p < pixels; ++p) labels_[v][p] = SkyLabel((p / 3 + v) % 4);
    }
    for (int i = 0; i < 16 * 8; ++i)
      light_.planes[0].push_back(0.3f + 0.5f * float(i % 16 < 8 ? i % 16 : 15 - i % 16) / 8);
  }
  void show_to(std::vector<TrainingView>& views) const {
    for (std::size_t v = 0; v < views.size(); ++v) {
      views[v].sky_labels = &labels_[v];
      views[v].sky = &light_;
    }
  }

 private:
  std::vector<std::vector<SkyLabel>> labels_;
  DirectionMap light_{16, 8, {{}}};
};

/// Depths of half of the cells, between the nearest and the farthest surface that a toy's cameras see.
class ToyDepths {
 public:
  explicit ToyDepths(std::size_t views) : hints_(views, {5, 4, std::vector<DepthHint>(5 * 4)}) {
    for (std::size_t v = 0; v < views; ++v) {
      for (std::size_t c = v % 2; c < hints_[v].cells.size(); c += 2) {
        hints_[v].cells[c] = {std::log(0.5f + 0.05f * float((c + v) % 7)), float(c % 3 + 2)};
      }
    }
  }
  void show_to(std::vector<TrainingView>& views) const {
    for (std::size_t v = 0; v < views.size(); ++v) views[v].depths = &hints_[v];
  }

 private:
  std::vector<DepthHints> hints_;
};

inline Capture toy_capture(int views = 4, int width = 24, int height = 20, bool with_alpha = false) {
  Capture capture;
  capture.format = "toy";
  capture.is_bounded_object = with_alpha;
  capture.bounds = Aabbd{{-1, -1, -1}, {1, 1, 1}};
  for (int v = 0; v < views; ++v) {
    View view;
    view.name = "toy" + std::to_string(v);
    view.intrinsics = {LensModel::kPinhole, width, height, 1.2 * width, 1.2 * width, 0.5 * width, 0.5 * height, {}};
    const double angle = 2 * std::numbers::pi * v / views;
    view.world_from_camera = look_at({3 * std::cos(angle), 3 * std::sin(angle), 1.0}, {0, 0, 0});
    view.image.width = width;
    view.image.height = height;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const double shade = 0.5 + 0.3 * std::sin(0.4 * x + v) * std::cos(0.3 * y);
        view.image.u8.push_back(std::uint8_t(255 * shade));
        const bool inside = std::hypot(x - 0.5 * width, y - 0.5 * height) < 0.4 * height;
        if (with_alpha) view.image.alpha.push_back(inside ? 255 : 0);
        if (with_alpha && !inside) view.image.u8.back() = 0;
      }
    }
    capture.views.push_back(std::move(view));
  }
  capture.listed_images = views;
  return capture;
}

}  // namespace cnerf::test
