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
  return static_cast<float>(options.learning_rate *
                            std::pow(options.final_learning_rate / options.learning_rate, decay));
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

LuminanceModel start_or_resume(const Capture& capture, const Stage1Options& options,
                               const std::filesystem::path& snapshot, bool resume) {
  if (!resume || !std::filesystem::exists(snapshot)) return LuminanceModel::create(capture, options);
  LuminanceModel model = LuminanceModel::load(snapshot);
  if (comparable(model.options) != comparable(options)) {
    throw SnapshotError(snapshot.string() +
                        ": was trained with other stage1 options; run with the same ones, or "
                        "without --resume");
  }
  model.options = options;
  return model;
}

}  // namespace

Stage1Report train_stage1(const Capture& capture, const Stage1Options& options, const std::filesystem::path& snapshot,
                          bool resume, const ProgressSink& progress) {
  LuminanceModel model = start_or_resume(capture, options, snapshot, resume);
  const std::vector<TrainingView> views = training_views(capture, model.frame);
  if (views.empty()) throw UsageError("capture.holdout: holds out every view; none is left to train on");

  const double seconds_before = model.seconds;
  const Stopwatch watch;
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
    model.seconds = seconds_before + watch.seconds();
    rays += double(step.rays);
    psnr.add(step.squared_error);

    const long done = model.engine->step_count();
    if (progress) {
      progress({"stage 1",
                fraction,
                {{"psnr", psnr.value()}, {"rays/s", rays / watch.seconds()}, {"samples", model.trained_samples}}});
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
