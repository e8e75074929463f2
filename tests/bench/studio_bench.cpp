// What waiting in the studio is like, on a run: first frames, the reach of a stroke, and colouring by strokes.
//   cnerf-studio-bench RUN [TAKE] [frames=1] [whole=1] [colour=1] [steps=N] [known=N] [kept=N] [rate=R] [final=R]
//     frames=1  only frames
//     whole=1   of which every pixel is traced
//     colour=1  only what colouring does
//   prints a row per figure; pictures differ from `cnerf render`'s by the dB of the sharp rows.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "src/base/error.h"
#include "src/base/statistics.h"
#include "src/base/usage.h"
#include "src/capture/load_capture.h"
#include "src/picture/encode.h"
#include "src/pipeline/run_directory.h"
#include "src/studio/field_view.h"
#include "src/train/chroma/retouch.h"
#include "src/train/chroma/strokes.h"
#include "src/train/luminance/learned_views.h"

namespace cnerf {
namespace {

double seconds_of(const std::function<void()>& work) {
  const Stopwatch watch;
  work();
  return watch.seconds();
}

void row(const char* what, double value, const char* unit) {
  fmt::print("{:<58} {:>8.3f} {}\n", what, value, unit);
  std::fflush(stdout);
}

double decibel(const Picture& a, const Picture& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.rgb.size(); ++i) sum += std::pow(double(a.rgb[i]) - b.rgb[i], 2);
  return 10 * std::log10(255.0 * 255.0 / std::max(sum / double(a.rgb.size()), 1e-9));
}

studio::FieldCamera camera_of(const View& view, double share) {
  // 1280 x 720 of the view's own field of vision, as a window shows it.
  const int width = int(1280 * share), height = int(720 * share);
  const double f = view.intrinsics.fy * height / view.intrinsics.height;
  return {{LensModel::kPinhole, width, height, f, f, width / 2.0, height / 2.0, {}}, view.world_from_camera};
}

/// How far pictures are from those of `cnerf render`, dB.
struct Sharpness {
  double grey = std::numeric_limits<double>::infinity(), color = grey;
  [[nodiscard]] Sharpness worse(const Sharpness& other) const {
    return {std::min(grey, other.grey), std::min(color, other.color)};
  }
};

/// Frames of a field, grey ones and of both sides.
struct Frames {
  const LuminanceModel& luminance;
  const Scene& scene;
  const ColorModel* model = nullptr;  ///< null: grey alone
  studio::DrawingEffort effort;

  /// @param view  of the camera, where the frame is to be compared with what `cnerf render` draws
  Sharpness measure(const studio::FieldCamera& camera, const std::string* view = nullptr) const {
    const std::string size = fmt::format(" {} x {}", camera.lens.width, camera.lens.height);
    const std::string of = view != nullptr ? size + " as " + *view : size;
    std::vector<studio::Side> sides = {nullptr};
    std::vector<Picture> pictures = draw(camera, sides, "frame, grey" + of);
    if (model != nullptr) {
      sides.push_back(model);
      pictures = draw(camera, sides, "frame, grey and colour" + of);
    }
    try {
      row(("encoding it" + size).c_str(), seconds_of([&] { (void)jpeg_bytes(pictures.back(), 85); }), "s");
    } catch (const DeviceError&) {
      fmt::print("encoding is not measured: this machine has no codecs\n");
    }
    if (view == nullptr) return {};
    const RenderedImage whole = scene.render(camera.lens, camera.world_from_camera, {});
    Sharpness sharpness;
    sharpness.grey = decibel(pictures[0], picture_from_linear(whole.width, whole.height, whole.luminance));
    row("  grey against cnerf render", sharpness.grey, "dB");
    if (model == nullptr) return sharpness;
    sharpness.color = decibel(pictures[1], picture_from_linear(whole.width, whole.height, whole.rgb));
    row("  colour against cnerf render", sharpness.color, "dB");
    return sharpness;
  }

 private:
  /// The quicker of two times.
  std::vector<Picture> draw(const studio::FieldCamera& camera, const std::vector<studio::Side>& sides,
                            const std::string& what) const {
    std::vector<Picture> pictures;
    studio::DrawingCosts costs;
    double seconds = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 2; ++i) {
      costs = {};
      seconds = std::min(seconds, seconds_of([&] {
                           pictures = studio::draw_field(
                               luminance, camera, sides, effort, [] { return true; }, &costs);
                         }));
    }
    row(what.c_str(), seconds, "s");
    const double pixels = double(camera.lens.width) * camera.lens.height;
    row("  pixels that are traced", 100 * double(costs.rays) / pixels, "%");
    if (sides.size() > 1) row("  and coloured", 100 * double(costs.colored_rays) / pixels, "%");
    return pictures;
  }
};

/// What colouring did to pixels of all views, ab distances.
struct Changes {
  double known = 0, kept = 0, kept_most = 0;
};
Changes changes_of(std::span<const CachedView> views, const KnownColorMap& map, const ColorModel* base,
                   const ColorModel& model) {
  std::vector<ViewPixel> places;
  for (std::uint32_t v = 0; v < views.size(); ++v) {
    for (std::uint32_t p = 0; p < views[v].opacity.size(); p += 37) {
      if (views[v].opacity[p] > 0.5f && views[v].luminance[p] > 0.05f) places.push_back({v, p});
    }
  }
  const PixelSamples pixels = pixel_samples(views, places);
  const std::vector<Ab> after = model.decode(pixels);
  const std::vector<Ab> before = base != nullptr ? base->decode(pixels) : std::vector<Ab>(places.size());
  std::vector<double> known, kept;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Ab* wanted = map.find(places[i].view, places[i].pixel);
    const Ab from = wanted != nullptr ? *wanted : before[i];
    (wanted != nullptr ? known : kept).push_back(std::hypot(after[i].a - from.a, after[i].b - from.b));
  }
  const auto mean = [](const std::vector<double>& of) {
    return std::accumulate(of.begin(), of.end(), 0.0) / double(std::max<std::size_t>(of.size(), 1));
  };
  return {mean(known), mean(kept), quantile(kept, 0.95)};
}

int bench(int argc, char** argv) {
  if (argc < 2) return std::puts("cnerf-studio-bench RUN [TAKE] [name=value...]"), 64;
  const pipeline::RunDirectory directory = pipeline::RunDirectory::open(argv[1]);
  Observer observer;
  const Config config = directory.config("", observer);
  Capture capture = survey_capture(directory.record().capture, config.capture);  // no pixels are looked at
  (void)apply_learned_views(capture, directory.stage1_snapshot());
  const Engines& engines = engines_for("auto");
  const std::string take = argc > 2 && std::string(argv[2]).find('=') == std::string::npos ? argv[2] : "";
  const bool is_grey = take.empty();
  const auto is_given = [&](const std::string& word) { return std::find(argv + 2, argv + argc, word) < argv + argc; };
  const bool is_about_color = is_given("colour=1"), is_about_frames = is_given("frames=1");
  const LuminanceModel luminance = LuminanceModel::load(directory.stage1_snapshot(), engines);
  ColorModel model =
      is_grey ? ColorModel::create(config.stage2, engines) : ColorModel::load(directory.take_snapshot(take), engines);
  const View& view = capture.views[capture.views.size() / 2];
  if (!is_about_color) {
    const auto scene = pipeline::load_scene(directory, take, {}, engines);
    Frames frames{luminance, *scene, is_grey ? nullptr : &model, studio::sharp_effort(config.render.steps_per_box)};
    if (is_given("whole=1")) frames.effort.least_sparse_pixels = 0;
    for (const double share : {1.0 / 8, 1.0 / 6}) frames.measure(camera_of(view, share));
    frames.measure(camera_of(view, 0.5), &view.name);
    Sharpness worst;
    for (const double place : {0.5, 0.1, 0.8}) {
      const View& own = capture.views[std::size_t(place * double(capture.views.size()))];
      worst = worst.worse(frames.measure(camera_of(own, 1), &own.name));
    }
    row("grey against cnerf render, worst of three cameras", worst.grey, "dB");
    if (!is_grey) row("colour against cnerf render, worst of three cameras", worst.color, "dB");
  }
  if (is_about_frames) return 0;

  ViewCache cache;
  row("caching views", seconds_of([&] {
        cache.fill(luminance.seen(), capture, luminance.frame, config.stage2.working_resolution, [](double) {});
      }),
      "s");
  const Stopwatch of_surfaces;
  const SeenSurfaces seen(cache.views(), cache.names());
  row("surfaces", of_surfaces.seconds(), "s");
  const std::size_t own = cache.views().size() / 2;
  Stroke stroke{.id = "a", .view = cache.names()[own], .color = "#c04030", .size = 0.03f};
  stroke.points = {{0.45f, 0.45f, 1}, {0.55f, 0.5f, 1}};
  const CachedView& painted = cache.views()[own];
  const Stopwatch of_own;
  const std::vector<KnownColors> known = {
      painted_on(stroke.view, std::span(&stroke, 1), painted.width, painted.height)};
  const KnownColorSources sources(seen, known);
  row("a stroke's reach in its own view", of_own.seconds(), "s");
  row("  share of the view",
      double(std::ranges::count_if(sources.sources()[0].colors.cost, [](float c) { return c < kUnreached; })) /
          double(painted.opacity.size()),
      "");
  row("and in eight others", seconds_of([&] {
        for (std::size_t v = 0; v < 8; ++v) (void)sources.seen_in(v);
      }),
      "s");
  row("eight thumbnails in colour", seconds_of([&] {
        for (std::size_t v = 0; v < 8; ++v) (void)studio::draw_cached(cache.views()[v], &model, 160, {});
      }),
      "s");
  const Stopwatch of_map;
  const KnownColorMap map(seen, sources);
  row("known colours of all views", of_map.seconds(), "s");
  ColorModel base = model.copy(engines);
  row("copying the model", seconds_of([&] { (void)model.copy(engines); }), "s");
  const auto number = [&](const std::string& name, double usual) {
    const auto given =
        std::find_if(argv + 2, argv + argc, [&](const std::string& word) { return word.starts_with(name + "="); });
    return given == argv + argc ? usual : std::stod(std::string(*given).substr(name.size() + 1));
  };
  RetouchOptions options;
  options.steps = int(number("steps", options.steps));
  options.known_pixels = int(number("known", options.known_pixels));
  options.kept_pixels = int(number("kept", options.kept_pixels));
  options.learning_rate = number("rate", options.learning_rate);
  options.final_learning_rate = number("final", options.final_learning_rate);
  Retouch retouch(cache.views(), map, is_grey ? nullptr : &base, model, options);
  row("first step of colouring", seconds_of([&] { retouch.step(); }), "s");
  row("all further steps", seconds_of([&] {
        while (!retouch.is_settled()) retouch.step();
      }),
      "s");
  const Changes changes = changes_of(cache.views(), map, is_grey ? nullptr : &base, model);
  row("ab distance to the stroke where it reaches, mean", changes.known, "");
  row("change elsewhere, mean", changes.kept, "");
  row("change elsewhere, 95 % below", changes.kept_most, "");
  return 0;
}

}  // namespace
}  // namespace cnerf

int main(int argc, char** argv) {
  return cnerf::bench(argc, argv);
}
