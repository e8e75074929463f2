#include "src/train/stage1.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "src/base/error.h"
#include "src/base/usage.h"
#include "src/train/luminance_model.h"
#include "src/train/options_json.h"

namespace cnerf {
namespace {

/// Constant over the first half of the steps, then an exponential decay.
float learning_rate(const Stage1Options& options, double fraction) {
  const double decay = std::clamp(2.0 * fraction - 1.0, 0.0, 1.0);
  return float(options.learning_rate * std::pow(options.final_learning_rate / options.learning_rate, decay));
}

/// Options that may differ between a run and its continuation: they say how long, not what.
nlohmann::json comparable(const Stage1Options& options) {
  nlohmann::json json = options_to_json(options);
  for (const char* duration : {"max_seconds", "checkpoint_every"}) json.erase(duration);
  return json;
}

/// Mean of the last values, as dB.
class RunningPsnr {
 public:
  void add(double squared_error) {
    window_.push_back(squared_error);
    if (window_.size() > 100) window_.pop_front();
  }
  [[nodiscard]] double value() const {
    double total = 0;
    for (const double error : window_) total += error;
    return window_.empty() ? 0 : -10 * std::log10(std::max(total / double(window_.size()), 1e-10));
  }

 private:
  std::deque<double> window_;
};

constexpr int kPreviews = 4;
constexpr int kPreviewSide = 200;  ///< pixels of the longer side

/// The views that previews show: held-out ones, else some of all.
std::vector<const View*> preview_views(const Capture& capture) {
  std::vector<const View*> held_out, all;
  for (const View& view : capture.views) (view.held_out ? held_out : all).push_back(&view);
  const std::vector<const View*>& from = held_out.empty() ? all : held_out;
  std::vector<const View*> chosen;
  for (std::size_t i = 0; i < kPreviews && i < from.size(); ++i) {
    chosen.push_back(from[i * from.size() / std::min<std::size_t>(kPreviews, from.size())]);
  }
  return chosen;
}

PreviewPicture preview_of(const LuminanceModel& model, const View& view) {
  const Intrinsics& full = view.intrinsics;
  const double scale = std::min(1.0, double(kPreviewSide) / std::max(full.width, full.height));
  const Intrinsics lens = resized(full, std::max(1, int(full.width * scale)), std::max(1, int(full.height * scale)));
  const UnitCamera camera(lens, view.world_from_camera, model.frame);
  PreviewPicture picture{view.name, lens.width, lens.height, {}, {}};
  std::vector<Ray> rays;
  for (int y = 0; y < lens.height; ++y) {
    for (int x = 0; x < lens.width; ++x) {
      rays.push_back(camera.ray({x + 0.5, y + 0.5}));
      const std::size_t column = std::size_t((x + 0.5) / lens.width * view.image.width);
      const std::size_t row = std::size_t((y + 0.5) / lens.height * view.image.height);
      picture.input.push_back(view.image.luminance(row * std::size_t(view.image.width) + column));
    }
  }
  std::vector<RayResult> results(rays.size());
  model.engine->render(rays, model.march(), {1e-2f, 0.9f}, results);
  for (const RayResult& result : results) picture.ours.push_back(result.luminance);
  return picture;
}

void refuse_others(const std::filesystem::path& snapshot, const Stage1Options& stored, const Stage1Options& options) {
  if (comparable(stored) == comparable(options)) return;
  throw SnapshotError(snapshot.string() +
                      ": was trained with other stage1 options; run with the same ones, or without --resume");
}

LuminanceModel start_or_resume(const Capture& capture, const Stage1Options& options,
                               const std::filesystem::path& snapshot, bool resume, const EngineMakers& makers) {
  if (!resume || !std::filesystem::exists(snapshot)) return LuminanceModel::create(capture, options, makers);
  LuminanceModel model = LuminanceModel::load(snapshot, makers);
  refuse_others(snapshot, model.options, options);
  model.options = options;
  return model;
}

}  // namespace

void check_continues(const std::filesystem::path& snapshot, const Stage1Options& options) {
  if (std::filesystem::exists(snapshot)) refuse_others(snapshot, LuminanceModel::options_in(snapshot), options);
}

Stage1Report train_stage1(const Capture& capture, const Stage1Options& options, const std::filesystem::path& snapshot,
                          bool resume, const ProgressSink& progress, const PreviewSink& previews,
                          const EngineMakers& makers) {
  LuminanceModel model = start_or_resume(capture, options, snapshot, resume, makers);
  const std::vector<TrainingView> views = training_views(capture, model.frame);
  if (views.empty()) throw UsageError("capture.holdout: holds out every view; none is left to train on");

  const double seconds_before = model.seconds;
  const Stopwatch watch;
  double told_seconds = 0;  // an observer's pauses and pictures are no training
  const std::vector<const View*> shown = preview_views(capture);
  const DrawPreview preview = [&](std::size_t index) { return preview_of(model, *shown[index % shown.size()]); };
  double rays = 0;
  RunningPsnr psnr;
  while (model.engine->step_count() < options.steps) {
    double fraction = double(model.engine->step_count()) / options.steps;
    if (options.max_seconds > 0) {
      if (model.seconds >= options.max_seconds) break;
      fraction = std::max(fraction, model.seconds / options.max_seconds);
    }
    const StepReport step = model.engine->step(views, learning_rate(options, fraction));
    model.trained_samples += double(step.trained_samples);
    model.seconds = seconds_before + watch.seconds() - told_seconds;
    rays += double(step.rays);
    psnr.add(step.squared_error);

    const long done = model.engine->step_count();
    if (progress) {
      const Stopwatch telling;
      progress({"stage 1",
                fraction,
                {{"psnr", psnr.value()},
                 {"loss", step.loss},
                 {"rays/s", rays / (watch.seconds() - told_seconds)},
                 {"samples", model.trained_samples}}});
      if (previews) previews(preview);
      told_seconds += telling.seconds();
    }
    if (interruption_requested()) {
      model.save(snapshot);
      throw Interrupted("stopped at step " + std::to_string(done) + "; saved " + snapshot.string() +
                        ", continue with --resume");
    }
    if (options.checkpoint_every > 0 && done % options.checkpoint_every == 0) model.save(snapshot);
  }
  model.save(snapshot);
  if (progress) progress({"stage 1", 1.0, {{"psnr", psnr.value()}}});
  return {int(model.engine->step_count()), model.seconds, model.trained_samples, psnr.value()};
}

}  // namespace cnerf
