#include "tests/support/held_out_views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>

#include "src/base/aabb.h"
#include "src/base/rng.h"
#include "src/base/statistics.h"
#include "src/color/colorspace_math.h"
#include "src/train/luminance/learned_views.h"
#include "tests/support/disturbed_capture.h"

namespace cnerf::test {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t kTracedEvery = 7;  // pixel, for the opacity near the camera
constexpr float kNearShare = 0.1f;

double encoded(double light) {
  return srgb_from_linear(std::clamp(float(light), 0.0f, 1.0f));
}

/// Of linear light, by least squares.
double fitted_gain(const std::vector<RayResult>& seen, const MonoImage& image) {
  GainFit fit;
  for (std::size_t p = 0; p < seen.size(); ++p) fit.add(seen[p].luminance, image.luminance(p));
  return fit.gain();
}

double near_opacity(const LuminanceEngine& engine, const UnitCamera& camera, const MonoImage& image,
                    const MarchSettings& march, const RenderEffort& effort) {
  std::vector<Ray> rays;
  std::vector<float> near_ends;
  for (std::size_t p = 0; p < image.pixel_count(); p += kTracedEvery) {
    rays.push_back(camera.ray_of_pixel(p));
    const auto inside = intersect(Aabbf{{0, 0, 0}, {1, 1, 1}}, rays.back().origin, rays.back().direction);
    const float begin = inside ? std::max(inside->begin, 0.0f) : 0;
    near_ends.push_back(inside ? begin + kNearShare * (inside->end - begin) : 0);
  }
  std::vector<WeightedSample> samples;
  std::vector<std::size_t> offsets;
  engine.trace(rays, march, effort, samples, offsets);
  double opacity = 0;
  for (std::size_t r = 0; r < rays.size(); ++r) {
    for (std::size_t s = offsets[r]; s < offsets[r + 1]; ++s) {
      if (samples[s].t < near_ends[r]) opacity += samples[s].weight;
    }
  }
  return opacity / double(rays.size());
}

void write_pair(const std::vector<RayResult>& seen, const MonoImage& image, const fs::path& file) {
  std::ofstream out(file, std::ios::binary);
  out << "P5 " << 2 * image.width << ' ' << image.height << " 255\n";
  for (int y = 0; y < image.height; ++y) {
    const std::size_t row = std::size_t(y) * std::size_t(image.width);
    for (int x = 0; x < image.width; ++x)
      out.put(char(std::lround(255 * encoded(seen[row + std::size_t(x)].luminance))));
    for (int x = 0; x < image.width; ++x)
      out.put(char(std::lround(255 * encoded(image.luminance(row + std::size_t(x))))));
  }
}

/// Pose and gain of a view by Levenberg and Marquardt's method, on pixels of the picture's left half, with slopes by
/// differences. What it finds is judged on the right half.
class PoseFit {
 public:
  PoseFit(const LuminanceEngine& engine, const MarchSettings& march, const RenderEffort& effort,
          const UnitCamera& camera, const MonoImage& image)
      : engine_(engine), march_(march), effort_(effort), camera_(camera), image_(image) {
    SequentialRng rng(1, named_stream("fit"));
    for (std::size_t i = 0; i < kPixels; ++i) {
      const std::size_t x = rng.below(std::uint32_t(image.width / 2)), y = rng.below(std::uint32_t(image.height));
      pixels_.push_back(y * std::size_t(image.width) + x);
    }
  }

  [[nodiscard]] ViewCorrection run() const {
    Numbers now{};
    double damping = 1e-3, best = squared(residuals(now, pixels_));
    for (int step = 0; step < kSteps; ++step) {
      const Numbers change = step_from(now, damping);
      Numbers next = now;
      for (int i = 0; i < kViewNumbers; ++i) next[std::size_t(i)] += change[std::size_t(i)];
      const double error = squared(residuals(next, pixels_));
      damping = error < best ? damping / 4 : damping * 8;
      if (error < best) {
        now = next;
        best = error;
      }
    }
    return correction(now);
  }

  [[nodiscard]] double psnr_of_right_half(const ViewCorrection& found) const {
    std::vector<std::size_t> right;
    for (std::size_t p = 0; p < image_.pixel_count(); ++p) {
      if (int(p % std::size_t(image_.width)) >= image_.width / 2) right.push_back(p);
    }
    const Numbers numbers = {found.log_gain, found.turn.x,  found.turn.y, found.turn.z,
                             found.shift.x,  found.shift.y, found.shift.z};
    return -10 * std::log10(std::max(squared(residuals(numbers, right)) / double(right.size()), 1e-10));
  }

 private:
  using Numbers = std::array<double, kViewNumbers>;
  static constexpr std::size_t kPixels = 6000;
  static constexpr int kSteps = 12;
  static constexpr double kDelta = 5e-4;  // radians, sides of the box, ln

  static ViewCorrection correction(const Numbers& n) {
    const auto of = [&](std::size_t i) { return Vec3d{n[i], n[i + 1], n[i + 2]}.cast<float>(); };
    return {float(n[0]), of(1), of(4)};
  }
  static double squared(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value * value;
    return sum;
  }
  [[nodiscard]] std::vector<double> residuals(const Numbers& numbers, const std::vector<std::size_t>& pixels) const {
    const ViewCorrection at = correction(numbers);
    std::vector<Ray> rays;
    for (const std::size_t pixel : pixels) rays.push_back(at.applied_to(camera_.ray_of_pixel(pixel)));
    std::vector<RayResult> seen(rays.size());
    engine_.render(rays, march_, effort_, seen);
    std::vector<double> off;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      off.push_back(encoded(double(at.gain()) * seen[i].luminance) - encoded(image_.luminance(pixels[i])));
    }
    return off;
  }
  /// -(J^T J + damping diag)^-1 J^T r
  [[nodiscard]] Numbers step_from(const Numbers& now, double damping) const {
    const std::vector<double> off = residuals(now, pixels_);
    std::array<std::vector<double>, kViewNumbers> slopes;
    for (std::size_t i = 0; i < slopes.size(); ++i) {
      Numbers up = now, down = now;
      up[i] += kDelta;
      down[i] -= kDelta;
      slopes[i] = residuals(up, pixels_);
      const std::vector<double> below = residuals(down, pixels_);
      for (std::size_t p = 0; p < off.size(); ++p) slopes[i][p] = (slopes[i][p] - below[p]) / (2 * kDelta);
    }
    std::array<std::array<double, kViewNumbers + 1>, kViewNumbers> system{};
    for (std::size_t r = 0; r < slopes.size(); ++r) {
      for (std::size_t c = 0; c < slopes.size(); ++c) {
        for (std::size_t p = 0; p < off.size(); ++p) system[r][c] += slopes[r][p] * slopes[c][p];
      }
      for (std::size_t p = 0; p < off.size(); ++p) system[r][kViewNumbers] -= slopes[r][p] * off[p];
      system[r][r] *= 1 + damping;
      system[r][r] += 1e-9;
    }
    // Gauss and Jordan: the matrix is positive definite.
    for (std::size_t k = 0; k < slopes.size(); ++k) {
      for (std::size_t c = slopes.size() + 1; c-- > k;) system[k][c] /= system[k][k];
      for (std::size_t r = 0; r < slopes.size(); ++r) {
        if (r == k) continue;
        for (std::size_t c = slopes.size() + 1; c-- > k;) system[r][c] -= system[r][k] * system[k][c];
      }
    }
    Numbers change{};
    for (std::size_t r = 0; r < slopes.size(); ++r) change[r] = system[r][kViewNumbers];
    return change;
  }

  const LuminanceEngine& engine_;
  MarchSettings march_;
  RenderEffort effort_;
  UnitCamera camera_;
  const MonoImage& image_;
  std::vector<std::size_t> pixels_;
};

}  // namespace

double psnr_of(const std::vector<RayResult>& seen, const MonoImage& image, double gain) {
  double squared = 0;
  for (std::size_t p = 0; p < seen.size(); ++p) {
    const double off = encoded(gain * seen[p].luminance) - encoded(image.luminance(p));
    squared += off * off;
  }
  return -10 * std::log10(std::max(squared / double(seen.size()), 1e-10));
}

std::vector<HeldOutView> Judge::judge() const {
  std::vector<HeldOutView> judged;
  const std::vector<ViewCorrection> corrections = engine.view_corrections();
  const std::vector<LensCorrection> learned = engine.lens_corrections();
  const std::vector<Intrinsics> lenses = lenses_of(capture);
  const std::vector<float> gains =
      corrections.empty() ? std::vector<float>(capture.views.size()) : log_gains(capture, corrections);
  for (std::size_t v = 0; v < gains.size(); ++v) {
    if (!capture.views[v].held_out) continue;
    View view = capture.views[v];
    const auto lens = std::size_t(std::ranges::find(lenses, view.intrinsics) - lenses.begin());
    if (lens < learned.size()) view.intrinsics = learned[lens].applied_to(view.intrinsics);
    judged.push_back(judge(view, gains[v]));
  }
  return judged;
}

HeldOutView Judge::judge(const View& view, float log_gain) const {
  const UnitCamera camera(view.intrinsics, view.world_from_camera, frame);
  std::vector<RayResult> seen(view.image.pixel_count());
  engine.render_view(camera, march, effort, seen);
  HeldOutView of;
  of.name = view.name;
  of.as_given = psnr_of(seen, view.image, std::exp(log_gain));
  of.exposure_fitted = psnr_of(seen, view.image, fitted_gain(seen, view.image));
  if (alignment) of.aligned = aligned(view);
  of.near_opacity = near_opacity(engine, camera, view.image, march, effort);
  if (!pictures.empty()) {
    fs::create_directories(pictures);
    write_pair(seen, view.image, pictures / (fs::path(view.name).stem().string() + ".pgm"));
  }
  return of;
}

double Judge::aligned(const View& view) const {
  const UnitCamera start(view.intrinsics, alignment->applied_to(view.world_from_camera), frame);
  PoseFit fit(engine, march, effort, start, view.image);
  const ViewCorrection found = fit.run();
  return fit.psnr_of_right_half(found);
}

PoseAlignment print_alignment(const Judge& judge, const std::vector<Affined>& truth) {
  const double reach = 0.5 / judge.frame.unit_per_world;
  const std::vector<Affined> given = training_poses(judge.capture);
  std::vector<Affined> learned = given;
  const std::vector<ViewCorrection> corrections = judge.engine.view_corrections();
  double least = 0, most = 0;
  for (std::size_t v = 0; v < corrections.size(); ++v) {
    learned[v] = corrected_pose(given[v], corrections[v], judge.frame);
    least = std::min(least, double(corrections[v].log_gain));
    most = std::max(most, double(corrections[v].log_gain));
  }
  for (const LensCorrection& lens : judge.engine.lens_corrections()) {
    std::printf("    lens: focal length times %.5f, principal point %+.4f %+.4f, k1 %+.4f k2 %+.4f p1 %+.5f p2 %+.5f\n",
                std::exp(double(lens.log_focal)), lens.x, lens.y, lens.k1, lens.k2, lens.p1, lens.p2);
  }
  const PoseAlignment found = align_poses(truth, learned, reach);
  std::printf("    rotations off the file's, median: %.4f degrees as given, %.4f learned; gains %.3f to %.3f\n",
              align_poses(truth, given, reach).median_degrees, found.median_degrees, std::exp(least), std::exp(most));
  return found;
}

void print_held_out(const std::vector<HeldOutView>& views) {
  HeldOutView mean, worst;
  worst.as_given = worst.exposure_fitted = worst.aligned = 1e9;
  for (const HeldOutView& view : views) {
    std::printf("    %-24s as given %.2f dB, exposure fitted %.2f dB, aligned %.2f dB, opacity near the camera %.4f\n",
                view.name.c_str(), view.as_given, view.exposure_fitted, view.aligned, view.near_opacity);
    mean.as_given += view.as_given / double(views.size());
    mean.exposure_fitted += view.exposure_fitted / double(views.size());
    mean.aligned += view.aligned / double(views.size());
    mean.near_opacity += view.near_opacity / double(views.size());
    worst.as_given = std::min(worst.as_given, view.as_given);
    worst.exposure_fitted = std::min(worst.exposure_fitted, view.exposure_fitted);
    worst.aligned = std::min(worst.aligned, view.aligned);
  }
  std::printf(
      "    mean / worst: as given %.2f / %.2f dB, exposure fitted %.2f / %.2f dB, aligned %.2f / %.2f dB, near opacity "
      "%.4f\n",
      mean.as_given, worst.as_given, mean.exposure_fitted, worst.exposure_fitted, mean.aligned, worst.aligned,
      mean.near_opacity);
}

}  // namespace cnerf::test
