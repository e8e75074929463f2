// How well the sky of a sample capture came out: luminance of held-out pixels that show nothing else, and how much the
// field puts before them. Pixels are told by the capture's sky/*.png (cnerf sample --sky).
//
//   cnerf-sky-check RUN CAPTURE [opacities=FOLDER]
//
// Prints a row per held-out view and the mean; with `opacities` also what the field covers of each view, as pictures.

#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "src/base/error.h"
#include "src/base/statistics.h"
#include "src/capture/load_capture.h"
#include "src/color/colorspace_math.h"
#include "src/picture/encode.h"
#include "src/train/luminance/learned_views.h"
#include "src/train/luminance/luminance_model.h"

namespace {

using namespace cnerf;
namespace fs = std::filesystem;

struct Row {
  double psnr = 0, opacity = 0, share = 0;
};

Row measure(const LuminanceModel& model, const View& view, const fs::path& sky_file, const fs::path& picture) {
  const cv::Mat1b sky = cv::imread(sky_file.string(), cv::IMREAD_GRAYSCALE);
  if (sky.cols != view.image.width || sky.rows != view.image.height) {
    throw InputError(sky_file, "size", "expected that of the view");
  }
  const UnitCamera camera(view.intrinsics, view.world_from_camera, model.frame);
  std::vector<RayResult> seen(view.image.pixel_count());
  model.engine->render_view(camera, model.march(512), {1e-3f, 1}, seen);
  std::vector<double> opacities;
  double error = 0;
  cv::Mat1b shown(sky.size());
  for (std::size_t p = 0; p < seen.size(); ++p) {
    shown(int(p)) = std::uint8_t(std::lround(255 * std::min(seen[p].opacity, 1.0f)));
    if (sky(int(p)) == 0) continue;
    const float light = seen[p].luminance + light_behind(model.sky_light(), camera.ray_of_pixel(p), seen[p].opacity);
    const auto encoded = [](float y) { return srgb_from_linear(std::clamp(y, 0.0f, 1.0f)); };
    error += std::pow(double(encoded(light) - encoded(view.image.luminance(p))), 2);
    opacities.push_back(double(seen[p].opacity));
  }
  if (!picture.empty()) write_png(picture, shown);
  const auto count = double(opacities.size());
  return {-10 * std::log10(std::max(error / count, 1e-10)), quantile(opacities, 0.99), count / double(seen.size())};
}

int run(const fs::path& folder, const fs::path& capture_path, const fs::path& pictures) {
  const fs::path snapshot = folder / "stage1.snapshot";
  Capture capture = load_capture(capture_path, {});
  apply_learned_views(capture, snapshot);
  const LuminanceModel model = LuminanceModel::load(snapshot, cpu_engines());
  std::printf("%-28s %8s %14s %8s\n", "view", "sky dB", "99 % opacity", "share");
  Row sum;
  int count = 0;
  for (const View& view : capture.views) {
    if (!view.held_out) continue;
    const fs::path name = fs::path(view.name).filename();
    const Row row = measure(model, view, capture_path / "sky" / name, pictures.empty() ? fs::path() : pictures / name);
    std::printf("%-28s %8.2f %14.4f %8.2f\n", view.name.c_str(), row.psnr, row.opacity, row.share);
    sum = {sum.psnr + row.psnr, sum.opacity + row.opacity, sum.share + row.share};
    ++count;
  }
  std::printf("%-28s %8.2f %14.4f %8.2f\n", "mean", sum.psnr / count, sum.opacity / count, sum.share / count);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "cnerf-sky-check RUN CAPTURE [opacities=FOLDER]\n");
    return 64;
  }
  const std::string last = argc > 3 ? argv[3] : "";
  try {
    return run(argv[1], argv[2], last.starts_with("opacities=") ? last.substr(10) : "");
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "%s\n", problem.what());
    return 1;
  }
}
