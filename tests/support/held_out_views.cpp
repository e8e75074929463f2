#include "tests/support/held_out_views.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>

#include "src/base/aabb.h"
#include "src/color/colorspace_math.h"

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
  double both = 0, own = 0;
  for (std::size_t p = 0; p < seen.size(); ++p) {
    both += double(seen[p].luminance) * image.luminance(p);
    own += double(seen[p].luminance) * seen[p].luminance;
  }
  return own > 0 ? both / own : 1;
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

}  // namespace

double psnr_of(const std::vector<RayResult>& seen, const MonoImage& image, double gain) {
  double squared = 0;
  for (std::size_t p = 0; p < seen.size(); ++p) {
    const double off = encoded(gain * seen[p].luminance) - encoded(image.luminance(p));
    squared += off * off;
  }
  return -10 * std::log10(std::max(squared / double(seen.size()), 1e-10));
}

std::vector<HeldOutView> judge_held_out(const Capture& capture, const SceneFrame& frame, const LuminanceEngine& engine,
                                        const MarchSettings& march, const RenderEffort& effort,
                                        const fs::path& pictures) {
  std::vector<HeldOutView> judged;
  for (const View& view : capture.views) {
    if (!view.held_out) continue;
    const UnitCamera camera(view.intrinsics, view.world_from_camera, frame);
    std::vector<RayResult> seen(view.image.pixel_count());
    engine.render_view(camera, march, effort, seen);
    HeldOutView of;
    of.name = view.name;
    of.as_given = psnr_of(seen, view.image);
    of.exposure_fitted = psnr_of(seen, view.image, fitted_gain(seen, view.image));
    of.near_opacity = near_opacity(engine, camera, view.image, march, effort);
    judged.push_back(of);
    if (!pictures.empty()) {
      fs::create_directories(pictures);
      write_pair(seen, view.image, pictures / (fs::path(view.name).stem().string() + ".pgm"));
    }
  }
  return judged;
}

void print_held_out(const std::vector<HeldOutView>& views) {
  HeldOutView mean, worst;
  worst.as_given = worst.exposure_fitted = 1e9;
  for (const HeldOutView& view : views) {
    std::printf("    %-24s as given %.2f dB, exposure fitted %.2f dB, opacity near the camera %.4f\n",
                view.name.c_str(), view.as_given, view.exposure_fitted, view.near_opacity);
    mean.as_given += view.as_given / double(views.size());
    mean.exposure_fitted += view.exposure_fitted / double(views.size());
    mean.near_opacity += view.near_opacity / double(views.size());
    worst.as_given = std::min(worst.as_given, view.as_given);
    worst.exposure_fitted = std::min(worst.exposure_fitted, view.exposure_fitted);
  }
  std::printf("    mean / worst: as given %.2f / %.2f dB, exposure fitted %.2f / %.2f dB, near opacity %.4f\n",
              mean.as_given, worst.as_given, mean.exposure_fitted, worst.exposure_fitted, mean.near_opacity);
}

}  // namespace cnerf::test
