// How near to the photographs' own colours strokes come, on a run whose capture has colours.
//   cnerf-stroke-error RUN STROKES.json [map=1] [maps=FOLDER]
//     map=1   only what strokes make known of the training views, before anything is learned
//     maps=F  writes the painted views' colours as they are known into folder F
//   prints the mean ab distance to the photographs' colours, and its share of what grey has. Held-out views are
//   coloured as the studio colours them, from grey.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "src/base/error.h"
#include "src/base/statistics.h"
#include "src/capture/color_truth.h"
#include "src/color/colorspace_math.h"
#include "src/evaluate/evaluate.h"
#include "src/picture/encode.h"
#include "src/pipeline/render_step.h"
#include "src/studio/coloring.h"
#include "src/studio/paint_files.h"
#include "tests/bench/bench_main.h"

namespace cnerf {
namespace {
namespace fs = std::filesystem;

void row(const std::string& what, double value, const char* unit) {
  fmt::print("{:<52} {:>8.2f} {}\n", what, value, unit);
  std::fflush(stdout);
}

struct Error {
  double ours = 0, grey = 0;
  void add(const Error& other) { ours += other.ours, grey += other.grey; }
  [[nodiscard]] double share() const { return 100 * ours / grey; }
};

/// Of what is known of a training view.
Error error_of(const RunningColors& known, const CachedView& seen, const View& view) {
  const auto truth = load_color_truth(view);
  if (!truth) throw UsageError(view.name + " has no colours");
  Error sum;
  for (std::size_t p = 0; p < seen.opacity.size(); ++p) {
    const int x = int((double(p % std::size_t(seen.width)) + 0.5) / seen.width * truth->width);
    const int y = int((double(p / std::size_t(seen.width)) + 0.5) / seen.height * truth->height);
    const float* rgb = &truth->rgb[3 * (std::size_t(y) * std::size_t(truth->width) + std::size_t(x))];
    const Lab<float> lab = lab_from_linear_rgb(Vec3f{rgb[0], rgb[1], rgb[2]});
    sum.add({std::hypot(known.ab[p].a - lab.a, known.ab[p].b - lab.b), std::hypot(lab.a, lab.b)});
  }
  return sum;
}

void write_map(const fs::path& file, const RunningColors& known, const CachedView& view) {
  Picture picture;
  picture.width = view.width, picture.height = view.height;
  for (std::size_t p = 0; p < view.opacity.size(); ++p) {
    const Vec3f rgb = linear_rgb_from_lab(Lab<float>{lightness_at(view, p), known.ab[p].a, known.ab[p].b});
    for (int i = 0; i < 3; ++i) {
      picture.rgb.push_back(std::uint8_t(std::clamp(srgb_from_linear(std::max(rgb[i], 0.0f)), 0.0f, 1.0f) * 255));
    }
  }
  write_png(file, picture);
}

void say_known(const pipeline::RunContext& context, const SeenSurfaces& seen, const StrokeList& list,
               const fs::path& maps) {
  const std::vector<KnownColors> known = studio::known_of(list, seen);
  const Stopwatch watch;
  const KnownColorSources sources(seen, known);
  row("strokes in the views that they are painted on", watch.seconds(), "s");
  Error own, others;
  const Stopwatch of_views;
  for (std::size_t v = 0; v < seen.names().size(); ++v) {
    const auto view = std::ranges::find(context.capture.views, seen.names()[v], &View::name);
    if (view == context.capture.views.end()) continue;
    const RunningColors colors = sources.seen_in(v);
    const bool is_painted = std::ranges::find(known, view->name, &KnownColors::view) != known.end();
    (is_painted ? own : others).add(error_of(colors, seen.views()[v], *view));
    if (!maps.empty() && (is_painted || v % 8 == 1))
      write_map(maps / (fs::path(view->name).stem().string() + ".png"), colors, seen.views()[v]);
  }
  row("all views, one after another", of_views.seconds(), "s");
  row("known colours of painted views, of grey's error", own.share(), "%");
  row("known colours of other training views", others.share(), "%");
}

int bench(int argc, char** argv) {
  if (argc < 3) return std::puts("cnerf-stroke-error RUN STROKES.json [map=1] [maps=FOLDER]"), 64;
  const pipeline::RunDirectory directory = pipeline::RunDirectory::open(argv[1]);
  Observer observer;
  const Config config = directory.config("", observer);
  pipeline::RunContext context{
      directory, config, pipeline::read_capture(directory.record().capture, config, observer), {"cnerf-stroke-error"}};
  pipeline::use_learned_views(context, observer);
  bool is_map = false;
  fs::path maps;
  for (int i = 3; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "map=1") is_map = true;
    if (word.starts_with("maps=")) maps = word.substr(5);
  }
  const Engines& engines = engines_for("auto");
  const StrokeList list = read_strokes(argv[2], paintable_views(context.capture));
  studio::Coloring coloring(context, engines);
  const Stopwatch of_caching;
  coloring.cache_views([](double) {});
  row("caching views", of_caching.seconds(), "s");
  coloring.see(painted_viewpoints(list), {});
  say_known(context, *coloring.seen(), list, maps);
  if (is_map) return 0;
  const Stopwatch watch;
  coloring.colour(list, {}, [](double) {});
  row("settled in", watch.seconds(), "s");
  const std::string take = directory.free_take_name("strokes");
  coloring.keep(take, watch.seconds(), observer);
  const auto scene = pipeline::load_scene(directory, take, {}, engines);
  EvaluateOptions options;
  options.render = pipeline::render_options(config);
  options.with_baked = false;
  const ViewMetrics mean = evaluate(*scene, context.capture, options).mean;
  row("held-out ab error", mean.ab_error.value_or(0), "");
  row("grey's", mean.ab_error_grey.value_or(0), "");
  row("share of grey's", Error{mean.ab_error.value_or(0), mean.ab_error_grey.value_or(1)}.share(), "%");
  fmt::print("take {}\n", take);
  return 0;
}

}  // namespace
}  // namespace cnerf

int main(int argc, char** argv) {
  return cnerf::bench_main("cnerf-stroke-error", cnerf::bench, argc, argv);
}
