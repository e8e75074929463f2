#include "src/train/luminance/stage1.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/usage.h"
#include "src/optim/adam.h"
#include "src/train/luminance/depth_hints.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/options_json.h"
#include "src/train/luminance/seen_sky.h"
#include "src/train/luminance/shared_steps.h"

namespace cnerf {
namespace {

/// Options that may differ between a run and its continuation: they say how long, not what.
nlohmann::json comparable(const Stage1Options& options) {
  nlohmann::json json = options_to_json(options);
  for (const char* duration : {"max_seconds", "least_gain", "checkpoint_every"}) json.erase(duration);
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
  for (int y = 0; y < lens.height; ++y) {
    for (int x = 0; x < lens.width; ++x) {
      const std::size_t column = std::size_t((x + 0.5) / lens.width * view.image.width);
      const std::size_t row = std::size_t((y + 0.5) / lens.height * view.image.height);
      picture.input.push_back(view.image.luminance(row * std::size_t(view.image.width) + column));
    }
  }
  std::vector<RayResult> results(picture.input.size());
  model.engine->render_view(camera, model.march(), {1e-2f, 0.9f}, results);
  for (std::size_t p = 0; p < results.size(); ++p) {
    const float behind = light_behind(model.sky_light(), camera.ray_of_pixel(p), results[p].opacity);
    picture.ours.push_back(results[p].luminance + behind);
  }
  return picture;
}

void refuse_others(const std::filesystem::path& snapshot, const Stage1Options& stored, const Stage1Options& options) {
  if (comparable(stored) == comparable(options)) return;
  throw SnapshotError(snapshot.string() +
                      ": was trained with other stage1 options; run with the same ones, or without --resume");
}

/// Earlier versions did not say.
void refuse_other_views(const std::filesystem::path& snapshot, const TrainedOn& stored, const Capture& capture) {
  if (!stored.views.empty() && stored.views != digest_of_training(capture)) {
    throw SnapshotError(snapshot.string() +
                        ": was trained on other views; capture.holdout, capture.downscale, capture.transfer and the "
                        "photographs' names and sizes have to be as they were, or start again without --resume");
  }
  refuse_other_cameras(snapshot, stored.cameras, capture);
}

SeenSky sky_of(const Stage1Job& job) {
  if (!job.options.sky) return {};
  return find_sky(job.capture, training_views(job.capture, {}), job.known_points());  // directions know no frame
}

FreeSpace free_space_of(const Stage1Job& job, const SeenSky& sky) {
  if (!job.options.free_space) return FreeSpace(job.capture.views, {});
  return FreeSpace(job.capture.views, job.known_points(), sky.labels);
}

LuminanceModel start_or_resume(const Stage1Job& job, const Engines& engines, const SeenSky& sky) {
  if (!job.goes_on()) {
    LuminanceModel model =
        LuminanceModel::create(job.capture, job.options, engines, free_space_of(job, sky), job.known_points());
    model.moved = job.moved;
    return model;
  }
  LuminanceModel model = LuminanceModel::load(job.snapshot, engines);
  refuse_others(job.snapshot, model.options, job.options);
  refuse_other_views(job.snapshot, model.trained_on, job.capture);
  const OccupancyOptions occupancy = model.options.occupancy;  // of what the engine has
  model.options = job.options;
  model.options.occupancy = occupancy;
  model.pace = TrainingPace(job.options.steps, job.options.least_gain, model.pace.state());
  return model;
}

float brightest_pixel(const View& view) {
  float brightest = 0;
  for (std::size_t p = 0; p < view.image.pixel_count() && std::isfinite(brightest); ++p) {
    const float luminance = view.image.luminance(p);
    if (!(luminance <= brightest)) brightest = luminance;  // or no number
  }
  return brightest;
}

/// Parameters that are not finite say no more where it began: the view furthest from what photographs hold is named.
[[noreturn]] void stop_diverged(const Capture& capture, long step, double loss) {
  const View* suspect = nullptr;
  for (const View& view : capture.views) {
    if (view.held_out || (suspect != nullptr && !std::isfinite(brightest_pixel(*suspect)))) continue;
    if (suspect == nullptr || !(brightest_pixel(view) <= brightest_pixel(*suspect))) suspect = &view;
  }
  CNERF_CHECK(suspect != nullptr, "there are views to train on");
  throw DivergedError(fmt::format(
      "stage 1: the loss is {} at step {}; the brightest view is {} with a luminance of {:g} (white is 1). The last "
      "snapshot is kept; a lower stage1.learning_rate may help",
      loss, step, suspect->name, brightest_pixel(*suspect)));
}

/// When ranks ask each other the time and whether one wants to stop: often enough for a person, and seldom enough not
/// to hold steps up. The same on all ranks.
long steps_to_next_question(const LuminanceModel& model) {
  constexpr double kSecondsBetween = 0.25;
  constexpr double kMostSteps = 16;
  const double seconds_of_step = model.seconds / double(std::max(1L, model.engine->step_count()));
  return long(std::clamp(kSecondsBetween / std::max(seconds_of_step, 1e-9), 1.0, kMostSteps));
}

/// What rank 0 saves, and all wait for.
void save_snapshot_of(const LuminanceModel& model, const Stage1Job& job) {
  model.engine->complete_state();
  if (job.ranks.is_first()) model.save(job.snapshot);
  job.ranks.barrier("snapshot of stage 1");
}

/// What a step that is done leaves to be agreed upon.
class AgreedTime {
 public:
  /// @param own  the time by this rank's clock, and whether its user cancelled
  /// @throws Interrupted  after saving, where any rank's user cancelled
  void after_step(LuminanceModel& model, const Stage1Job& job, const CommonMind& own) {
    const long done = model.engine->step_count();
    if (!job.ranks.is_alone() && done < next_question_) return;
    const CommonMind mind = job.ranks.is_alone() ? own : own.among(job.ranks);
    model.seconds = mind.seconds;
    next_question_ = done + steps_to_next_question(model);
    if (!mind.is_cancelled) return;
    save_snapshot_of(model, job);
    throw Interrupted("stopped at step " + std::to_string(done) + "; saved " + job.snapshot.string() +
                      ", continue with --resume");
  }

 private:
  long next_question_ = 0;  // the step
};

/// Ranks decide by the mean of what they saw.
void pace_after_step(LuminanceModel& model, const StepReport& step, cluster::Ranks& ranks) {
  model.pace.after_step(model.engine->step_count(), step.squared_error, [&](double own) {
    ranks.sum(std::span<double>(&own, 1));
    return own / ranks.size();
  });
}

/// Its light by the views' exposures, poses and lenses as they were learned.
DirectionMap learned_sky(const LuminanceEngine& engine, const SeenSky& sky, std::vector<TrainingView> views) {
  const std::vector<LensCorrection> lenses = engine.lens_corrections();
  for (TrainingView& view : views) {
    if (!lenses.empty()) view.camera.intrinsics = lenses[std::size_t(view.lens)].applied_to(view.camera.intrinsics);
  }
  return sky_light(views, sky.labels, engine.view_corrections());
}

/// Done so far, of the steps or of the time, whichever is nearer to its end.
double fraction_done(const LuminanceModel& model, const Stage1Options& options) {
  const double of_steps = double(model.engine->step_count()) / double(model.pace.steps());
  return options.max_seconds > 0 ? std::max(of_steps, model.seconds / options.max_seconds) : of_steps;
}

}  // namespace

void check_views(const std::filesystem::path& snapshot, const Capture& capture) {
  if (std::filesystem::exists(snapshot)) refuse_other_views(snapshot, LuminanceModel::trained_on_in(snapshot), capture);
}

void check_continues(const std::filesystem::path& snapshot, const Stage1Options& options) {
  if (std::filesystem::exists(snapshot)) refuse_others(snapshot, LuminanceModel::options_in(snapshot), options);
}

Stage1Report train_stage1(const Stage1Job& job, const Engines& engines, Observer& observer) {
  const Stage1Options& options = job.options;
  const SeenSky sky = sky_of(job);
  LuminanceModel model = start_or_resume(job, engines, sky);
  say_kernels(job.snapshot, model.kernels_before, model.kernels, observer);
  std::vector<TrainingView> views = training_views(job.capture, model.frame);
  if (views.empty()) throw UsageError("capture.holdout: holds out every view; none is left to train on");
  sky.show_to(views);
  model.sky = sky.light;
  const std::vector<DepthHints> depths = depth_hints(job.capture, model.frame, job.known_points());
  show_to(views, depths);
  model.engine->limit_image_memory(job.image_memory);
  model.engine->share_steps(share_of(job.ranks));  // takes its memory before the views take what is free
  model.engine->set_views(views);

  TrainingClock clock;
  AgreedTime agreed;
  const double seconds_before = model.seconds;
  const std::vector<const View*> shown = preview_views(job.capture);
  const DrawPreview preview = [&](std::size_t index) { return preview_of(model, *shown[index % shown.size()]); };
  double rays = 0;
  RunningPsnr psnr;
  while (model.engine->step_count() < model.pace.steps()) {
    if (options.max_seconds > 0 && model.seconds >= options.max_seconds) break;
    const double fraction = fraction_done(model, options);
    const StepReport step =
        model.engine->step(decayed_rate(options.learning_rate, options.final_learning_rate, fraction));
    model.trained_samples += double(step.trained_samples);
    const double seconds = seconds_before + clock.seconds();
    rays += double(step.rays);
    psnr.add(step.squared_error);
    if (!std::isfinite(step.loss + step.squared_error)) {
      stop_diverged(job.capture, model.engine->step_count(), step.loss);
    }
    clock.pause_for([&] {
      const double samples = model.trained_samples, rays_per_second = rays / clock.seconds();
      observer.report_progress(
          {"stage 1",
           fraction,
           {{"psnr", psnr.value()}, {"loss", step.loss}, {"rays/s", rays_per_second}, {"samples", samples}}});
      observer.offer_preview(preview);
      if (job.watch) job.watch(model);
    });

    pace_after_step(model, step, job.ranks);
    agreed.after_step(model, job, {seconds, observer.is_cancelled()});
    if (options.checkpoint_every > 0 && model.engine->step_count() % options.checkpoint_every == 0) {
      save_snapshot_of(model, job);
    }
  }
  if (model.sky.exists()) model.sky = learned_sky(*model.engine, sky, views);
  save_snapshot_of(model, job);
  observer.report_progress({"stage 1", 1.0, {{"psnr", psnr.value()}}});
  return {int(model.engine->step_count()),
          model.seconds,
          model.trained_samples,
          psnr.value(),
          sky.views(),
          sky.share(views)};
}

}  // namespace cnerf
