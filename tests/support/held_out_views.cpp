#include "tests/support/held_out_views.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>

#include "src/evaluate/held_out_camera.h"
#include "src/evaluate/psnr.h"
#include "src/train/luminance/learned_views.h"
#include "tests/support/disturbed_capture.h"

namespace cnerf::test {
namespace fs = std::filesystem;
namespace {

std::vector<float> luminance_of(const std::vector<RayResult>& seen) {
  std::vector<float> luminance;
  for (const RayResult& result : seen) luminance.push_back(result.luminance);
  return luminance;
}

void write_pair(const std::vector<RayResult>& seen, const MonoImage& image, const fs::path& file) {
  std::ofstream out(file, std::ios::binary);
  out << "P5 " << 2 * image.width << ' ' << image.height << " 255\n";
  for (int y = 0; y < image.height; ++y) {
    const std::size_t row = std::size_t(y) * std::size_t(image.width);
    for (int x = 0; x < image.width; ++x)
      out.put(char(std::lround(255 * encoded_value(seen[row + std::size_t(x)].luminance))));
    for (int x = 0; x < image.width; ++x)
      out.put(char(std::lround(255 * encoded_value(image.luminance(row + std::size_t(x))))));
  }
}

}  // namespace

double psnr_of(const std::vector<RayResult>& seen, const MonoImage& image, double gain) {
  std::vector<float> ours = luminance_of(seen);
  for (float& value : ours) value *= float(gain);
  return psnr_from_mse(encoded_mse(ours, luminance_plane(image), 1, image.mask));
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
  of.exposure_fitted =
      psnr_of(seen, view.image, fitted_gain(luminance_of(seen), luminance_plane(view.image), view.image.mask));
  const SeenScene scene{engine, march};
  if (alignment) {
    const UnitCamera start(view.intrinsics, alignment->applied_to(view.world_from_camera), frame);
    if (const auto fitted = fit_camera(scene, effort, start, view.image)) of.aligned = fitted->psnr;
  }
  of.near_opacity = near_opacity(scene, effort, camera);
  if (!pictures.empty()) {
    fs::create_directories(pictures);
    write_pair(seen, view.image, pictures / (fs::path(view.name).stem().string() + ".pgm"));
  }
  return of;
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
