#include "src/compare/learning_curve.h"

#include <algorithm>
#include <cmath>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/rng.h"
#include "src/capture/color_truth.h"
#include "src/color/colorspace_math.h"
#include "src/render/training_views.h"
#include "src/train/chroma/color_model.h"
#include "src/train/luminance/seen_scene.h"
#include "src/train/luminance/view_cache.h"

namespace cnerf::compare {
namespace {

constexpr double kFirstMeasurement = 0.1;  // seconds of training
constexpr double kNextMeasurement = 1.4;   // times the last one's
constexpr RenderEffort kEffort = {1e-3f, 0.995f};
constexpr std::uint64_t kPixelSeed = named_stream("held");
constexpr float kMostlyField = 0.5f;  // opacity, of a pixel before a sky whose colour is the field's

float encoded(float luminance) {
  return srgb_from_linear(std::clamp(luminance, 0.0f, 1.0f));
}

Ab true_color(const ColorImage& truth, std::size_t pixel) {
  const float* rgb = truth.rgb.data() + 3 * pixel;
  return ab_of_linear_rgb({rgb[0], rgb[1], rgb[2]});
}

}  // namespace

std::optional<double> seconds_to(std::span<const LearningPoint> curve, double wanted, int better) {
  for (std::size_t i = 0; i < curve.size(); ++i) {
    if (better * (curve[i].value - wanted) < 0) continue;
    if (i == 0) return curve[0].seconds;
    const LearningPoint &before = curve[i - 1], &after = curve[i];
    const double share = (wanted - before.value) / (after.value - before.value);
    return before.seconds + share * (after.seconds - before.seconds);
  }
  return std::nullopt;
}

double value_at(std::span<const LearningPoint> curve, double seconds) {
  CNERF_CHECK(!curve.empty(), "a curve without points");
  const auto after = std::ranges::find_if(curve, [&](const LearningPoint& point) { return point.seconds >= seconds; });
  if (after == curve.end()) return curve.back().value;
  if (after == curve.begin()) return curve.front().value;
  const LearningPoint& before = *std::prev(after);
  const double share = (seconds - before.seconds) / (after->seconds - before.seconds);
  return before.value + share * (after->value - before.value);
}

HeldOutPixels::HeldOutPixels(std::span<const View* const> views, const SceneFrame& frame, std::size_t count) {
  for (std::size_t v = 0; v < views.size(); ++v) {
    const View& view = *views[v];
    const UnitCamera camera(view.intrinsics, view.world_from_camera, frame);
    const std::optional<ColorImage> truth = load_color_truth(view);
    const CounterRng rng(kPixelSeed, v);
    for (std::size_t i = v * count / views.size(); i < (v + 1) * count / views.size(); ++i) {
      const std::size_t pixel = rng.below(i, std::uint32_t(view.image.pixel_count()));
      if (!view.image.valid(pixel)) continue;
      const auto width = std::size_t(view.image.width);
      rays_.push_back(camera.ray({double(pixel % width) + 0.5, double(pixel / width) + 0.5}));
      luminance_.push_back(view.image.luminance(pixel));
      colors_.push_back(truth ? std::optional(true_color(*truth, pixel)) : std::nullopt);
    }
  }
  CNERF_CHECK(!rays_.empty(), "no pixel to look at");
}

double HeldOutPixels::psnr(const LuminanceEngine& engine, const MarchSettings& march, const DirectionView& sky) const {
  std::vector<RayResult> seen(rays_.size());
  engine.render(rays_, march, kEffort, seen);
  add_sky(sky, rays_, seen);
  double sum = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const double error = double(encoded(seen[i].luminance)) - double(encoded(luminance_[i]));
    sum += error * error;
  }
  return -10 * std::log10(std::max(sum / double(seen.size()), 1e-10));
}

void HeldOutPixels::trace(const LuminanceEngine& engine, const MarchSettings& march, const DirectionView& sky) {
  std::vector<WeightedSample> samples;
  std::vector<std::size_t> offsets;
  engine.trace(rays_, march, kEffort, samples, offsets);
  samples_ = pixel_samples(rays_, samples, offsets);
  has_sky_ = sky.values != nullptr;
}

double HeldOutPixels::ab_error(const ColorBinEngine& engine, float temperature) const {
  CNERF_CHECK_EQ(samples_.pixels(), rays_.size());
  std::vector<Ab> decoded(rays_.size());
  engine.decode(samples_, temperature, decoded);
  const std::vector<float> luminance = pixel_luminance(samples_);
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < decoded.size(); ++i) {
    const float opacity = samples_.opacity(i);
    if (!colors_[i] || (has_sky_ && opacity < kMostlyField)) continue;
    const Ab ours = opacity < kLeastColoredOpacity ? Ab{} : in_gamut(decoded[i], luminance[i]);
    sum += std::hypot(double(ours.a - colors_[i]->a), double(ours.b - colors_[i]->b));
    ++count;
  }
  if (count == 0) throw InputError("none of the held-out pixels that were drawn has a colour to compare with");
  return sum / double(count);
}

void LearningCurve::report_progress(const Progress& progress) {
  inner_.report_progress(progress);
  const bool is_training = progress.task == task_;
  if (!is_training && points_.empty()) clock_.emplace();  // training begins after this
  if (!is_training) return;
  if (!clock_) clock_.emplace();
  last_ = clock_->seconds() - paused_;
  if (last_ >= next_) measure(last_);
}

void LearningCurve::measure(double now) {
  const Stopwatch watch;
  points_.push_back({now, measure_()});
  // Not longer measuring than training.
  next_ = std::max({kFirstMeasurement, kNextMeasurement * now, now + watch.seconds()});
  paused_ += watch.seconds();
}

}  // namespace cnerf::compare
