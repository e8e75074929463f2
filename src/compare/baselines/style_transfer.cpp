#include "src/compare/baselines/style_transfer.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/usage.h"
#include "src/capture/color_truth.h"
#include "src/color/colorspace_math.h"
#include "src/compare/stage2_variants.h"
#include "src/train/chroma/color_model.h"
#include "src/train/chroma/patches.h"
#include "src/train/luminance/luminance_model.h"

namespace cnerf::compare {
namespace {

constexpr double kCachedWeight = 0.97;   // of a pixel, as in stage 2's caches but at less effort
constexpr double kMatchingShare = 0.25;  // of the steps: matching colours before features
constexpr float kLeastGradient = 1e-12f;
constexpr float kGradientReach = 10.0f;  // ab units between a pixel and its target where the derivative is usual

/// A picture's pixels with the samples behind them.
struct StyledView {
  CachedView view;
  PixelSamples pixels;
  LabPicture picture;  // lightness as rendered; ab is written at each step
};

std::vector<StyledView> styled_views(const Capture& capture, const LuminanceModel& luminance, Observer& observer) {
  std::vector<StyledView> styled;
  const std::vector<TrainingView> views = training_views(capture, luminance.frame);
  for (const TrainingView& view : views) {
    if (observer.is_cancelled()) throw Interrupted("style transfer stopped; nothing was written");
    StyledView one;
    one.view = cache_view(luminance.seen(), view.camera, kStyleSide, kCachedWeight);
    ignore_masked(one.view, *view.image);
    std::vector<ViewPixel> all(one.view.luminance.size());
    for (std::size_t p = 0; p < all.size(); ++p) all[p].pixel = std::uint32_t(p);
    one.pixels = pixel_samples(std::span(&one.view, 1), all);
    one.picture = {one.view.width, one.view.height, {}, {}};
    for (const float y : one.view.luminance) {
      one.picture.lightness.push_back(std::clamp(lightness_from_luminance(y), 0.0f, 100.0f));
    }
    one.picture.ab.resize(2 * all.size());
    styled.push_back(std::move(one));
    observer.report_progress({"style: views", double(styled.size()) / double(views.size()), {}});
  }
  if (styled.empty()) throw UsageError("capture.holdout: holds out every view; none is left to colorize");
  return styled;
}

/// The best affine function of L* for a channel of the reference: {value at 0, slope}.
std::pair<double, double> regression(std::span<const float> lightness, std::span<const float> values) {
  const auto n = double(values.size());
  double l = 0, v = 0, ll = 0, lv = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    l += lightness[i] / n;
    v += values[i] / n;
    ll += double(lightness[i]) * lightness[i] / n;
    lv += double(lightness[i]) * values[i] / n;
  }
  const double variance = ll - l * l;
  const double slope = variance > 1e-6 ? (lv - l * v) / variance : 0;
  return {v - slope * l, slope};
}

LabPicture lab_picture(const cv::Mat& linear_rgb) {
  LabPicture picture{linear_rgb.cols, linear_rgb.rows, {}, std::vector<float>(2 * linear_rgb.total())};
  for (std::size_t i = 0; i < linear_rgb.total(); ++i) {
    const auto& rgb = linear_rgb.at<cv::Vec3f>(int(i) / linear_rgb.cols, int(i) % linear_rgb.cols);
    const Lab<float> lab = lab_from_linear_rgb(Vec3f{rgb[0], rgb[1], rgb[2]});
    picture.lightness.push_back(lab.lightness);
    picture.ab[i] = lab.a;
    picture.ab[linear_rgb.total() + i] = lab.b;
  }
  return picture;
}

/// Where each pixel's colour should go: down the loss's derivative, which the squared distance to it then has.
std::vector<Ab> targets_of(const LabPicture& picture, std::span<const float> gradient) {
  const std::size_t n = picture.lightness.size();
  double squares = 0;
  for (const float value : gradient) squares += double(value) * value;
  // Adam does not care about the scale; this one keeps it away from the smallest floats.
  const auto scale = float(kGradientReach / (std::sqrt(squares / double(n)) + kLeastGradient));
  std::vector<Ab> targets(n);
  for (std::size_t p = 0; p < n; ++p) {
    targets[p] = {picture.ab[p] - scale * gradient[p], picture.ab[n + p] - scale * gradient[n + p]};
  }
  return targets;
}

/// Colours towards which ARF's first steps go: the reference's as a function of lightness.
class MatchedColors {
 public:
  explicit MatchedColors(const LabPicture& reference) {
    const std::span<const float> ab(reference.ab);
    a_ = regression(reference.lightness, ab.first(reference.lightness.size()));
    b_ = regression(reference.lightness, ab.last(reference.lightness.size()));
  }
  [[nodiscard]] std::vector<Ab> of(const LabPicture& picture) const {
    std::vector<Ab> colors;
    for (const double lightness : picture.lightness) {
      colors.push_back({float(a_.first + a_.second * lightness), float(b_.first + b_.second * lightness)});
    }
    return colors;
  }

 private:
  std::pair<double, double> a_, b_;  // value at 0, slope
};

/// Writes the field's colours to the picture.
void show(const ColorModel& model, StyledView& view) {
  const std::size_t n = view.picture.lightness.size();
  std::vector<Ab> colors(n);
  model.chromaticity->composite(view.pixels, colors);
  for (std::size_t p = 0; p < n; ++p) {
    view.picture.ab[p] = colors[p].a;
    view.picture.ab[n + p] = colors[p].b;
  }
}

}  // namespace

double transfer_style(const StyleJob& job, const Engines& engines, Observer& observer) {
  const Stopwatch watch;
  std::vector<StyledView> views = styled_views(job.capture, LuminanceModel::load(job.stage1, engines), observer);
  ColorModel model = ColorModel::create(job.options, engines);
  model.pixel_colors = PixelColors::kField;
  model.colorizer = job.colorizer;
  model.stage1_sha256 = sha256(read_binary_file(job.stage1));

  const auto matched = job.reference == nullptr ? std::nullopt : std::optional<MatchedColors>(*job.reference);
  const int matching = matched ? int(kMatchingShare * job.steps) : 0;
  double loss = 0;
  for (int step = 0; step < job.steps; ++step) {
    if (observer.is_cancelled()) throw Interrupted("style transfer stopped; nothing was written");
    StyledView& view = views[std::size_t(step) % views.size()];
    std::vector<Ab> targets;
    if (step < matching) {
      targets = matched->of(view.picture);
    } else {
      show(model, view);
      std::vector<float> gradient(view.picture.ab.size());
      loss = job.loss(view.picture, gradient);
      targets = targets_of(view.picture, gradient);
    }
    const double fraction = std::clamp(2.0 * step / job.steps - 1.0, 0.0, 1.0);
    const double from = job.options.learning_rate, to = job.options.final_learning_rate;
    (void)model.chromaticity->step(view.pixels, targets, view.view.opacity, AbLoss::kSquared,
                                   float(from * std::pow(to / from, fraction)));
    observer.report_progress({"style transfer", double(step + 1) / job.steps, {{"loss", loss}}});
  }
  model.report.seconds = watch.seconds();
  model.save(job.take);
  return model.report.seconds;
}

LabPicture colorized_view(const Capture& capture, const std::filesystem::path& stage1_snapshot, Colorizer& colorizer,
                          const Engines& engines) {
  const LuminanceModel luminance = LuminanceModel::load(stage1_snapshot, engines);
  std::vector<const View*> training;
  for (const View& view : capture.views) {
    if (!view.held_out) training.push_back(&view);
  }
  if (training.empty()) throw UsageError("capture.holdout: holds out every view; none is left to colorize");
  const std::size_t middle = training.size() / 2;
  const UnitCamera camera(training[middle]->intrinsics, training[middle]->world_from_camera, luminance.frame);
  const CachedView view = cache_view(luminance.seen(), camera, kStyleSide, kCachedWeight);
  LightnessBatch question = whole_view(view, training[middle]->name, middle, kStyleSide);
  const ChromaBatch answer = colorizer.colorize(question);
  check_answer(colorizer.name(), question, answer);
  return {question.width, question.height, std::move(question.lightness), ab_of(answer, 0)};
}

LabPicture reference_image(const std::filesystem::path& file) {
  const ColorImage image = load_color_image(file);
  const cv::Mat full(image.height, image.width, CV_32FC3, const_cast<float*>(image.rgb.data()));
  const double factor = std::min(1.0, double(kStyleSide) / std::min(image.width, image.height));
  cv::Mat small;
  cv::resize(full, small, {}, factor, factor, cv::INTER_AREA);
  return lab_picture(small);
}

}  // namespace cnerf::compare
