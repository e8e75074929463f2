// Makes of a capture whose views follow one another (`cnerf sample --path orbit`) what a user might have of the same
// scene: a film clip with the marks of age, or the stream of a spike camera.
//
//   film_clip CAPTURE CLIP.mp4 [fps=24] [flicker=0] [grain=0] [letterbox=0] [duplicates=0] [pan=0] [seed=1]
//   film_clip CAPTURE STREAM.dat [ticks=64] [seed=1]
//   film_clip CAPTURE FOLDER [frames=60] [x=0 y=0 width=0 height=0]
//
// views       of the capture that are taken, from the first on; 0: all
// flicker     each frame's light is multiplied by 1 +- up to this many percent
// grain       standard deviation of the noise, codes
// letterbox   rows of black above and below
// duplicates  frames that are shown twice
// pan         frames of a second shot, after a hard cut, in which the camera only turns
// ticks       of the stream for each view; views fade into one another. A pixel gathers luminance and fires at 1
// FOLDER      becomes a capture of evenly spread views with their true poses, clean and without alpha: what the others
//             are compared with. x, y, width and height: the part of the pictures that `cnerf prepare` kept of a clip

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <set>
#include <string>

#include "src/base/files.h"
#include "src/base/rng.h"
#include "src/capture/load_capture.h"
#include "src/color/colorspace_math.h"
#include "src/picture/encode.h"
#include "src/prepare/capture_writer.h"
#include "tests/bench/comparison_support.h"

namespace {

namespace fs = std::filesystem;
using cnerf::Capture;
using cnerf::SequentialRng;
using cnerf::View;
using Options = std::map<std::string, int>;

/// Linear luminance of a view over black.
cv::Mat1f light_of(const View& view) {
  cv::Mat1f light(view.image.height, view.image.width);
  for (std::size_t p = 0; p < view.image.pixel_count(); ++p) light(int(p)) = view.image.luminance(p);
  return light;
}

float normal(SequentialRng& rng) {
  return std::sqrt(-2 * std::log(1 - rng.uniform())) * std::cos(6.2831853f * rng.uniform());
}

cv::Mat1b codes_of(const cv::Mat1f& light, double gain, double grain, SequentialRng& rng) {
  cv::Mat1b codes(light.size());
  for (int p = 0; p < int(light.total()); ++p) {
    const double code =
        255 * cnerf::srgb_from_linear(std::clamp(double(light(p / light.cols, p % light.cols)) * gain, 0.0, 1.0));
    codes(p) = cv::saturate_cast<std::uint8_t>(code + (grain > 0 ? grain * double(normal(rng)) : 0));
  }
  return codes;
}

/// What the camera sees after a turn about its vertical axis: no parallax, whatever the scene.
cv::Mat1f turned(const cv::Mat1f& light, const cnerf::Intrinsics& lens, double radians) {
  const double c = std::cos(radians), s = std::sin(radians);
  const cv::Matx33d camera(lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1), turn(c, 0, s, 0, 1, 0, -s, 0, c);
  cv::Mat1f out;
  cv::warpPerspective(light, out, camera * turn * camera.inv(), light.size(), cv::INTER_LINEAR, cv::BORDER_REFLECT);
  return out;
}

bool write_clip(const Capture& capture, const fs::path& file, const Options& options) {
  SequentialRng rng(std::uint64_t(options.at("seed")), 0);
  const int bars = options.at("letterbox");
  const View& first = capture.views.front();
  cv::VideoWriter writer(file.string(), cv::VideoWriter::fourcc('m', 'p', '4', 'v'), options.at("fps"),
                         {first.image.width, first.image.height + 2 * bars}, true);
  if (!writer.isOpened()) return false;
  std::set<std::size_t> twice;
  while (int(twice.size()) < std::min(options.at("duplicates"), int(capture.views.size()) - 1)) {
    twice.insert(1 + rng.below(std::uint32_t(capture.views.size() - 1)));
  }
  const auto write = [&](const cv::Mat1f& light, int times) {
    const double gain = 1 + 0.01 * options.at("flicker") * double(rng.uniform(-1, 1));
    cv::Mat picture = codes_of(light, gain, options.at("grain"), rng);
    cv::copyMakeBorder(picture, picture, bars, bars, 0, 0, cv::BORDER_CONSTANT, cv::Scalar(0));
    cv::cvtColor(picture, picture, cv::COLOR_GRAY2BGR);
    for (int i = 0; i < times; ++i) writer.write(picture);
  };
  for (std::size_t i = 0; i < capture.views.size(); ++i) write(light_of(capture.views[i]), twice.contains(i) ? 2 : 1);
  const int pan = options.at("pan");
  const cv::Mat1f seen = light_of(capture.views[capture.views.size() / 2]);
  for (int i = 0; i < pan; ++i) write(turned(seen, first.intrinsics, 0.006 * (i - pan / 2)), 1);
  return true;
}

void write_stream(const Capture& capture, const fs::path& file, const Options& options) {
  SequentialRng rng(std::uint64_t(options.at("seed")), 0);
  const std::size_t pixels = capture.views.front().image.pixel_count();
  std::vector<float> charge(pixels);
  for (float& gathered : charge) gathered = rng.uniform();
  std::vector<std::byte> bits;
  cv::Mat1f before = light_of(capture.views.front());
  for (const View& view : capture.views) {
    const cv::Mat1f after = light_of(view);
    for (int tick = 0; tick < options.at("ticks"); ++tick) {
      const cv::Mat1f light = before + (after - before) * (float(tick) / float(options.at("ticks")));
      bits.resize(bits.size() + (pixels + 7) / 8);
      std::byte* const row = &bits[bits.size() - (pixels + 7) / 8];
      for (std::size_t p = 0; p < pixels; ++p) {
        charge[p] += std::min(light(int(p)), 1.0f);
        if (charge[p] < 1) continue;
        charge[p] -= 1;
        row[p / 8] |= std::byte(1u << (p % 8));
      }
    }
    before = after;
  }
  cnerf::write_file(file, bits);
}

void write_capture(const Capture& capture, const fs::path& folder, const Options& options) {
  SequentialRng rng(1, 0);
  const View& first = capture.views.front();
  cv::Rect kept(options.at("x"), options.at("y"), options.at("width"), options.at("height"));
  if (kept.empty()) kept = {0, 0, first.image.width, first.image.height};
  std::vector<View> views;
  const auto count = std::size_t(options.at("frames"));
  for (std::size_t i = 0; i < count; ++i) {
    View view = capture.views[i * capture.views.size() / count];
    view.name = fs::path(view.name).filename().string();
    cnerf::write_png(folder / "images" / view.name, codes_of(light_of(view)(kept), 1, 0, rng));
    cnerf::Intrinsics& lens = view.intrinsics;
    lens.cx -= kept.x, lens.cy -= kept.y, lens.width = kept.width, lens.height = kept.height;
    views.push_back(std::move(view));
  }
  nlohmann::ordered_json transforms = cnerf::prepare::transforms_json(views, {}, std::nullopt);
  const cnerf::Aabbd& box = *capture.bounds;
  transforms["aabb"] = {{box.min.x, box.min.y, box.min.z}, {box.max.x, box.max.y, box.max.z}};
  cnerf::write_file(folder / "transforms.json", transforms.dump(1) + "\n");
}

}  // namespace

int main(int argc, char** argv) {
  const auto [files, options] = cnerf::bench::parse_arguments(argc, argv,
                                                              {{"fps", 24},
                                                               {"flicker", 0},
                                                               {"grain", 0},
                                                               {"letterbox", 0},
                                                               {"duplicates", 0},
                                                               {"pan", 0},
                                                               {"ticks", 64},
                                                               {"frames", 60},
                                                               {"x", 0},
                                                               {"y", 0},
                                                               {"width", 0},
                                                               {"height", 0},
                                                               {"views", 0},
                                                               {"seed", 1}});
  if (files.size() != 2) {
    std::puts(
        "film_clip CAPTURE OUT.mp4|OUT.dat|FOLDER [fps=24] [flicker=%] [grain=codes] [letterbox=rows] "
        "[duplicates=N] [pan=frames] [ticks=64] [frames=60] [x= y= width= height=] [views=0] [seed=1]");
    return 64;
  }
  Capture capture = cnerf::load_capture(files[0]);
  const auto wanted = std::size_t(options.at("views"));
  if (wanted > 0 && wanted < capture.views.size()) capture.views.resize(wanted);
  const fs::path out = files[1];
  if (out.extension() == ".dat") {
    write_stream(capture, out, options);
  } else if (out.has_extension()) {
    if (!write_clip(capture, out, options)) {
      std::fprintf(stderr, "%s: OpenCV cannot write it\n", out.c_str());
      return 74;
    }
  } else {
    write_capture(capture, out, options);
  }
  return 0;
}
