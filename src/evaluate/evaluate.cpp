#include "src/evaluate/evaluate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <future>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/base/statistics.h"
#include "src/evaluate/held_out_camera.h"
#include "src/picture/picture.h"

namespace cnerf {
namespace {

/// Pixels below this opacity have no colour of their own (design: the decode divides by opacity).
constexpr float kColouredOpacity = 0.01f;
/// Of views that are measured at the same time; each holds a hundred bytes per pixel meanwhile.
constexpr std::size_t kPixelsAtATime = std::size_t(1) << 24;

std::vector<float> channel(std::span<const float> rgb, int index) {
  std::vector<float> values(rgb.size() / 3);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = rgb[3 * i + index];
  return values;
}

std::optional<double> ssim_of_channels(const std::vector<float>& ours, const std::vector<float>& truth, int width,
                                       int height, std::span<const std::uint8_t> valid) {
  std::array<std::optional<double>, 3> of_channel;
  parallel_tasks(of_channel.size(), [&](std::size_t c) {
    of_channel[c] = ssim(channel(ours, int(c)), channel(truth, int(c)), width, height, valid);
  });
  double sum = 0;
  for (const std::optional<double>& one : of_channel) {
    if (!one) return std::nullopt;
    sum += *one / 3;
  }
  return sum;
}

std::vector<std::uint8_t> coloured_pixels(const RenderedImage& image, std::span<const std::uint8_t> valid) {
  std::vector<std::uint8_t> pixels(image.opacity.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    pixels[i] = image.opacity[i] >= kColouredOpacity && (valid.empty() || valid[i] != 0);
  }
  return pixels;
}

void measure_luminance(const EvaluatedView& pictures, ViewMetrics& metrics) {
  const MonoImage& image = pictures.view.image;
  const std::vector<float> truth = luminance_plane(image);
  const std::vector<float>& ours = pictures.ours.luminance;
  metrics.psnr_luminance = psnr_from_mse(encoded_mse(ours, truth, 1, image.mask));
  std::vector<float> at_its_exposure = ours;
  const auto gain = float(fitted_gain(ours, truth, image.mask));
  for (float& value : at_its_exposure) value *= gain;
  metrics.psnr_luminance_exposure_fitted = psnr_from_mse(encoded_mse(at_its_exposure, truth, 1, image.mask));
  metrics.ssim = ssim(encoded(pictures.ours.luminance), encoded(truth), image.width, image.height, image.mask);
}

void measure_colour(const EvaluatedView& pictures, ViewMetrics& metrics) {
  if (pictures.ours.rgb.empty()) return;
  const std::span<const std::uint8_t> valid = pictures.view.image.mask;
  const std::vector<float>& ours = pictures.ours.rgb;
  const Colorfulness colorful = colorfulness(srgb8_from_linear(ours), valid);
  metrics.colorfulness = colorful.standard;
  metrics.colorfulness_magnitude = colorful.magnitude;
  metrics.color_diversity = color_diversity(ours, valid);
  if (!pictures.truth) return;

  const std::vector<float>& truth = pictures.truth->rgb;
  const Colorfulness wanted = colorfulness(srgb8_from_linear(truth), valid);
  metrics.colorfulness_truth = wanted.standard;
  metrics.colorfulness_magnitude_truth = wanted.magnitude;
  metrics.colorfulness_difference = colorful.standard - wanted.standard;
  metrics.colorfulness_magnitude_difference = colorful.magnitude - wanted.magnitude;
  metrics.color_diversity_truth = color_diversity(truth, valid);
  metrics.color_diversity_difference = *metrics.color_diversity - *metrics.color_diversity_truth;
  metrics.psnr_rgb = psnr_from_mse(encoded_mse(ours, truth, 3, valid));
  metrics.ssim_rgb = ssim_of_channels(encoded(ours), encoded(truth), pictures.ours.width, pictures.ours.height, valid);
  metrics.ab_error = mean_ab_distance(ours, truth, valid);
  metrics.ab_error_grey = mean_ab_distance(truth, {}, valid);
}

void measure_baked(const EvaluatedView& pictures, ViewMetrics& metrics) {
  const RenderedImage& ours = pictures.ours;
  if (ours.rgb.empty() || ours.baked_rgb.empty()) return;
  metrics.bake_ab_distance =
      mean_ab_distance(ours.baked_rgb, ours.rgb, coloured_pixels(ours, pictures.view.image.mask));
}

/// Networks know no masks: where the mask says to ignore a pixel, they see the truth in both pictures.
void show_truth_where_masked(const MonoImage& image, const std::vector<std::uint8_t>& truth,
                             std::vector<std::uint8_t>& ours) {
  for (std::size_t i = 0; i < image.pixel_count(); ++i) {
    if (!image.valid(i)) std::copy_n(truth.begin() + std::ptrdiff_t(3 * i), 3, ours.begin() + std::ptrdiff_t(3 * i));
  }
}

/// Networks have one memory for what passes through them: not for several threads.
void measure_by_networks(const EvaluatedView& pictures, const EvaluateOptions& options, ViewMetrics& metrics) {
  if (pictures.ours.rgb.empty() || !pictures.truth) return;
  const auto& mask = pictures.view.image.mask;
  if (!mask.empty() && std::ranges::count(mask, 0) == std::ssize(mask)) return;  // they would find equal pictures
  const int width = pictures.ours.width, height = pictures.ours.height;
  std::vector<std::uint8_t> ours = srgb8_from_linear(pictures.ours.rgb);
  const std::vector<std::uint8_t> truth = srgb8_from_linear(pictures.truth->rgb);
  show_truth_where_masked(pictures.view.image, truth, ours);
  const bool is_large = std::min(width, height) >= Lpips::kLeastSide;
  if (options.lpips != nullptr && is_large) metrics.lpips = options.lpips->distance(ours, truth, width, height);
  if (options.encoder == nullptr) return;
  metrics.features_ours = options.encoder->regions(ours, width, height);
  metrics.features_truth = options.encoder->regions(truth, width, height);
}

/// Engines share their threads among rays: not for several views at once.
void measure_camera(const Scene& scene, const View& view, const EvaluateOptions& options, ViewMetrics& metrics) {
  const auto seen = scene.seen(options.render);
  if (!seen) return;
  const RenderEffort effort = options.render.effort();
  const UnitCamera given(view.intrinsics, view.world_from_camera, scene.frame());
  metrics.near_opacity = near_opacity(*seen, effort, given);
  if (!options.alignment || !view.held_out) return;
  const UnitCamera start(view.intrinsics, options.alignment->applied_to(view.world_from_camera), scene.frame());
  if (const auto fitted = fit_camera(*seen, effort, start, view.image)) metrics.psnr_luminance_aligned = fitted->psnr;
}

/// A number without a pixel behind it is no number.
void drop_nan(ViewMetrics& metrics) {
  ViewMetrics::visit_numbers(metrics, [](const char*, std::optional<double>& value) {
    if (value && !std::isfinite(*value)) value.reset();
  });
}

/// How many views are measured at the same time.
std::size_t views_at_a_time(const std::vector<const View*>& views) {
  std::size_t most_pixels = 1;
  for (const View* view : views) {
    most_pixels = std::max(most_pixels, std::size_t(view->intrinsics.width) * std::size_t(view->intrinsics.height));
  }
  return std::clamp<std::size_t>(kPixelsAtATime / most_pixels, 1, std::size_t(thread_count()));
}

/// The luminance of a picture as its colour.
void paint_grey(RenderedImage& image) {
  for (const float y : image.luminance) image.rgb.insert(image.rgb.end(), {y, y, y});
}

}  // namespace

ViewMetrics mean_of(const std::vector<ViewMetrics>& views) {
  std::map<std::string, std::pair<double, int>> sums;  // and of how many
  for (const ViewMetrics& view : views) {
    ViewMetrics::visit_numbers(view, [&](const char* name, const std::optional<double>& value) {
      if (!value) return;
      auto& [sum, count] = sums[name];
      sum += *value;
      ++count;
    });
  }
  ViewMetrics mean;
  ViewMetrics::visit_numbers(mean, [&](const char* name, std::optional<double>& value) {
    if (const auto found = sums.find(name); found != sums.end()) value = found->second.first / found->second.second;
  });
  return mean;
}

std::map<std::string, Spread> spread_of(const std::vector<ViewMetrics>& views) {
  // The lower the worse, but for opacity.
  static const std::map<std::string, double> kWorse = {{"psnr_luminance", -1},
                                                       {"psnr_luminance_exposure_fitted", -1},
                                                       {"psnr_luminance_aligned", -1},
                                                       {"ssim", -1},
                                                       {"near_opacity", 1}};
  std::map<std::string, std::vector<std::pair<double, std::string>>> values;
  for (const ViewMetrics& view : views) {
    ViewMetrics::visit_numbers(view, [&](const char* name, const std::optional<double>& value) {
      if (value && kWorse.contains(name)) values[name].emplace_back(*value, view.view);
    });
  }
  std::map<std::string, Spread> spread;
  for (const auto& [name, of_views] : values) {
    const double sign = kWorse.at(name);
    std::vector<double> badness;
    for (const auto& [value, view] : of_views) badness.push_back(sign * value);
    const auto worst = std::ranges::max_element(badness) - badness.begin();
    const auto from_worst = [&](double share) { return sign * quantile(badness, 1 - share); };
    spread[name] = {of_views[std::size_t(worst)].first, of_views[std::size_t(worst)].second, from_worst(0.1),
                    from_worst(0.25), from_worst(0.5)};
  }
  return spread;
}

void summarise(Metrics& metrics) {
  metrics.mean = mean_of(metrics.views);
  metrics.spread = spread_of(metrics.views);
  constexpr std::size_t kSamples = std::size_t(PictureEncoder::kRegions) * PictureEncoder::kRegions;  // of a view
  std::vector<float> ours, truth;
  std::size_t dimensions = 0;
  for (ViewMetrics& view : metrics.views) {
    dimensions = std::max(dimensions, view.features_ours.size() / kSamples);
    ours.insert(ours.end(), view.features_ours.begin(), view.features_ours.end());
    truth.insert(truth.end(), view.features_truth.begin(), view.features_truth.end());
    view.features_ours = view.features_truth = {};
  }
  if (!ours.empty()) metrics.feature_distance = frechet_distance(ours, truth, dimensions);
}

std::string split_of(const std::vector<const View*>& views) {
  return views.front()->held_out ? "held-out" : "train";
}

Progress progress_of(const Metrics& metrics, std::size_t views) {
  return {"evaluate",
          double(metrics.views.size()) / double(views),
          {{"psnr", metrics.views.back().psnr_luminance.value_or(0)}}};
}

std::vector<const View*> views_to_evaluate(const Capture& capture, const EvaluateOptions& options) {
  std::vector<const View*> held_out, all;
  for (const View& view : capture.views) {
    all.push_back(&view);
    if (view.held_out) held_out.push_back(&view);
  }
  if (!held_out.empty()) return held_out;
  std::vector<const View*> some;
  const std::size_t count = std::min<std::size_t>(all.size(), options.training_views);
  for (std::size_t i = 0; i < count; ++i) some.push_back(all[i * all.size() / count]);
  return some;
}

ViewMetrics measure(const EvaluatedView& pictures) {
  CNERF_CHECK_EQ(pictures.ours.width, pictures.view.image.width);
  CNERF_CHECK_EQ(pictures.ours.height, pictures.view.image.height);
  ViewMetrics metrics;
  metrics.view = pictures.view.name;
  const std::array<void (*)(const EvaluatedView&, ViewMetrics&), 3> parts = {&measure_luminance, &measure_colour,
                                                                             &measure_baked};
  parallel_tasks(parts.size(), [&](std::size_t part) { parts[part](pictures, metrics); });
  drop_nan(metrics);
  return metrics;
}

std::vector<ViewMetrics> evaluate_views(const Scene& scene, std::span<const View* const> views,
                                        const EvaluateOptions& options,
                                        const std::function<void(const EvaluatedView&)>& watch) {
  RenderOptions render = options.render;
  render.color = scene.is_colorized();
  render.baked_color = scene.is_colorized() && options.with_baked;
  std::vector<RenderedImage> ours(views.size());
  std::vector<std::optional<ColorImage>> truth(views.size());
  std::vector<std::future<ViewMetrics>> measuring;  // beside the engine's work on the next views
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (interruption_requested()) throw Interrupted("evaluation stopped; nothing was written");
    ours[i] = scene.render(views[i]->intrinsics, views[i]->world_from_camera, render);
    if (ours[i].rgb.empty() && options.grey_as_color) paint_grey(ours[i]);
    measuring.push_back(std::async(std::launch::async, [&view = *views[i], &own = ours[i], &given = truth[i]] {
      given = load_color_truth(view);
      return measure({view, own, given});
    }));
  }
  std::vector<ViewMetrics> measured;
  for (std::size_t i = 0; i < views.size(); ++i) {
    measured.push_back(measuring[i].get());
    const EvaluatedView pictures{*views[i], ours[i], truth[i]};
    measure_camera(scene, *views[i], options, measured.back());
    if (options.lpips != nullptr || options.encoder != nullptr) measure_by_networks(pictures, options, measured.back());
    if (watch) watch(pictures);
  }
  return measured;
}

Metrics evaluate(const Scene& scene, const Capture& capture, const EvaluateOptions& options,
                 const std::function<void(const EvaluatedView&)>& watch, const ProgressSink& progress) {
  const std::vector<const View*> views = views_to_evaluate(capture, options);
  Metrics metrics;
  metrics.split = split_of(views);
  const std::size_t at_a_time = views_at_a_time(views);
  for (std::size_t begin = 0; begin < views.size(); begin += at_a_time) {
    const std::size_t count = std::min(at_a_time, views.size() - begin);
    for (ViewMetrics& measured : evaluate_views(scene, std::span(views).subspan(begin, count), options, watch)) {
      metrics.views.push_back(std::move(measured));
      if (progress) progress(progress_of(metrics, views.size()));
    }
  }
  summarise(metrics);
  return metrics;
}

}  // namespace cnerf
