#include "src/evaluate/held_out_camera.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "src/base/aabb.h"
#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/evaluate/psnr.h"

namespace cnerf {
namespace {

constexpr std::size_t kTracedEvery = 7;  // pixel, for the opacity near the camera
constexpr float kNearShare = 0.1f;

using Numbers = std::array<double, kViewNumbers>;

ViewCorrection correction_of(const Numbers& n) {
  const auto vector_at = [&](std::size_t i) { return Vec3d{n[i], n[i + 1], n[i + 2]}.cast<float>(); };
  return {float(n[0]), vector_at(1), vector_at(4)};
}

double squared(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return sum;
}

/// Solves A x = b, given as [A | b], by Gauss and Jordan's method without pivots: A is positive definite.
Numbers solved(std::array<std::array<double, kViewNumbers + 1>, kViewNumbers> system) {
  for (std::size_t k = 0; k < system.size(); ++k) {
    for (std::size_t c = system.size() + 1; c-- > k;) system[k][c] /= system[k][k];
    for (std::size_t r = 0; r < system.size(); ++r) {
      if (r == k) continue;
      for (std::size_t c = system.size() + 1; c-- > k;) system[r][c] -= system[r][k] * system[k][c];
    }
  }
  Numbers x{};
  for (std::size_t r = 0; r < system.size(); ++r) x[r] = system[r][kViewNumbers];
  return x;
}

class CameraFit {
 public:
  CameraFit(const SeenScene& scene, const RenderEffort& effort, const UnitCamera& camera, const MonoImage& image)
      : scene_(scene), effort_(effort), camera_(camera), image_(image) {}

  /// @param pixels  to fit to
  [[nodiscard]] ViewCorrection run(const std::vector<std::size_t>& pixels) const {
    Numbers now{};
    double damping = 1e-3, least = squared(residuals(correction_of(now), pixels));
    for (int step = 0; step < kSteps; ++step) {
      const Numbers change = step_from(now, damping, pixels);
      Numbers next = now;
      for (std::size_t i = 0; i < next.size(); ++i) next[i] += change[i];
      const double error = squared(residuals(correction_of(next), pixels));
      damping = error < least ? damping / 4 : damping * 8;
      if (!(error < least)) continue;
      now = next;
      least = error;
    }
    return correction_of(now);
  }
  [[nodiscard]] double psnr(const ViewCorrection& at, const std::vector<std::size_t>& pixels) const {
    return psnr_from_mse(squared(residuals(at, pixels)) / double(pixels.size()));
  }

 private:
  static constexpr int kSteps = 12;
  static constexpr double kDelta = 5e-4;  // radians, sides of the box, ln

  [[nodiscard]] std::vector<double> residuals(const ViewCorrection& at, const std::vector<std::size_t>& pixels) const {
    std::vector<Ray> rays;
    for (const std::size_t pixel : pixels) rays.push_back(at.applied_to(camera_.ray_of_pixel(pixel)));
    std::vector<RayResult> seen(rays.size());
    scene_.engine.render(rays, scene_.march, effort_, seen);
    add_sky(scene_.sky, rays, seen);
    std::vector<double> off;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      off.push_back(double(encoded_value(at.gain() * seen[i].luminance)) -
                    double(encoded_value(image_.luminance(pixels[i]))));
    }
    return off;
  }

  /// -(J^T J + damping diag)^-1 J^T r
  [[nodiscard]] Numbers step_from(const Numbers& now, double damping, const std::vector<std::size_t>& pixels) const {
    const std::vector<double> off = residuals(correction_of(now), pixels);
    std::array<std::vector<double>, kViewNumbers> slopes;
    for (std::size_t i = 0; i < slopes.size(); ++i) {
      Numbers up = now, down = now;
      up[i] += kDelta;
      down[i] -= kDelta;
      slopes[i] = residuals(correction_of(up), pixels);
      const std::vector<double> below = residuals(correction_of(down), pixels);
      for (std::size_t p = 0; p < off.size(); ++p) slopes[i][p] = (slopes[i][p] - below[p]) / (2 * kDelta);
    }
    std::array<std::array<double, kViewNumbers + 1>, kViewNumbers> system{};
    for (std::size_t r = 0; r < slopes.size(); ++r) {
      for (std::size_t c = 0; c < slopes.size(); ++c) {
        for (std::size_t p = 0; p < off.size(); ++p) system[r][c] += slopes[r][p] * slopes[c][p];
      }
      for (std::size_t p = 0; p < off.size(); ++p) system[r][kViewNumbers] -= slopes[r][p] * off[p];
      system[r][r] *= 1 + damping;
      system[r][r] += 1e-9;  // a number that changes nothing
    }
    return solved(system);
  }

  SeenScene scene_;
  RenderEffort effort_;
  UnitCamera camera_;
  const MonoImage& image_;
};

/// Of the left half, drawn at random: as many as tell seven numbers.
std::vector<std::size_t> pixels_to_fit(const MonoImage& image) {
  constexpr int kPixels = 6000;
  std::vector<std::size_t> pixels;
  if (image.width < 2) return pixels;
  SequentialRng rng(1, named_stream("fit"));
  for (int i = 0; i < kPixels; ++i) {
    const std::size_t x = rng.below(std::uint32_t(image.width / 2)), y = rng.below(std::uint32_t(image.height));
    const std::size_t pixel = y * std::size_t(image.width) + x;
    if (image.valid(pixel)) pixels.push_back(pixel);
  }
  return pixels;
}

std::vector<std::size_t> right_half(const MonoImage& image) {
  std::vector<std::size_t> pixels;
  for (std::size_t p = 0; p < image.pixel_count(); ++p) {
    if (int(p % std::size_t(image.width)) >= image.width / 2 && image.valid(p)) pixels.push_back(p);
  }
  return pixels;
}

}  // namespace

std::optional<PoseAlignment> alignment_of(const Capture& learned, const LearnedViews& views) {
  std::vector<Affined> given, found;
  bool moved = !views.lenses.empty();
  for (const View& view : learned.views) {
    if (view.held_out || found.size() == views.corrections.size()) continue;
    const ViewCorrection& correction = views.corrections[found.size()];
    moved = moved || length(correction.turn) > 0 || length(correction.shift) > 0;
    found.push_back(view.world_from_camera);
    given.push_back(given_pose(view.world_from_camera, correction, views.frame));
  }
  if (!moved || found.empty()) return std::nullopt;
  return align_poses(given, found, 0.5 / views.frame.unit_per_world);
}

std::optional<FittedCamera> fit_camera(const SeenScene& scene, const RenderEffort& effort, const UnitCamera& start,
                                       const MonoImage& image) {
  const std::vector<std::size_t> left = pixels_to_fit(image), right = right_half(image);
  if (left.empty() || right.empty()) return std::nullopt;
  const CameraFit fit(scene, effort, start, image);
  FittedCamera found;
  found.correction = fit.run(left);
  found.psnr = fit.psnr(found.correction, right);
  return found;
}

double near_opacity(const SeenScene& scene, const RenderEffort& effort, const UnitCamera& camera) {
  constexpr std::size_t kGrain = 1024;  // rays of a parallel piece of work
  const std::size_t pixels = std::size_t(camera.intrinsics.width) * std::size_t(camera.intrinsics.height);
  const std::size_t all = (pixels + kTracedEvery - 1) / kTracedEvery, at_a_time = scene.engine.rays_at_a_time();
  double opacity = 0;
  for (std::size_t first = 0; first < all; first += at_a_time) {
    std::vector<Ray> rays(std::min(at_a_time, all - first));
    parallel_each(rays.size(), kGrain,
                  [&](std::size_t r) { rays[r] = camera.ray_of_pixel((first + r) * kTracedEvery); });
    std::vector<WeightedSample> samples;
    std::vector<std::size_t> offsets;
    scene.engine.trace(rays, scene.march, effort, samples, offsets);
    std::vector<float> near(rays.size());
    parallel_ranges(rays.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r) {
        const auto inside = intersect(Aabbf{{0, 0, 0}, {1, 1, 1}}, rays[r].origin, rays[r].direction);
        if (!inside) continue;
        const float start = std::max(inside->begin, 0.0f), near_end = start + kNearShare * (inside->end - start);
        for (std::size_t s = offsets[r]; s < offsets[r + 1]; ++s) {
          if (samples[s].t < near_end) near[r] += samples[s].weight;
        }
      }
    });
    opacity += std::accumulate(near.begin(), near.end(), 0.0);
  }
  return opacity / double(std::max<std::size_t>(1, all));
}

}  // namespace cnerf
