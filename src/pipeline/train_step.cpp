#include "src/pipeline/train_step.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "src/base/text.h"
#include "src/base/usage.h"
#include "src/pipeline/shared_training.h"
#include "src/prepare/bundle_adjustment.h"
#include "src/prepare/sparse_points.h"
#include "src/train/luminance/stage1.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

/// Adjusts the capture's cameras to what its views show, and says how far they were off.
prepare::AdjustedCameras adjust(Capture& capture, const Stage1Options& options, Observer& observer) {
  const Stopwatch watch;
  prepare::AdjustedCameras cameras = prepare::adjust_cameras(capture, options, observer);
  const std::string time = duration_text(watch.seconds());
  if (cameras.evidence == 0) {
    observer.say("cameras stay where they were given: views show too few points in common");
  } else if (cameras.moved.corrections.empty()) {
    observer.say(
        fmt::format("cameras stay where they were given: points are {:.2f} pixels off, {:.2f} were they moved, in {}",
                    cameras.error_before, cameras.error_after, time));
  } else {
    observer.say(fmt::format("cameras adjusted: points are {:.2f} pixels off, {:.2f} before, in {}",
                             cameras.error_after, cameras.error_before, time));
  }
  return cameras;
}

Stage1Report train(const RunContext& context, const TrainJob& job, bool goes_on, cluster::Ranks& ranks,
                   const Engines& engines, Observer& observer) {
  const Stage1Options& options = context.config.stage1;
  std::optional<Capture> adjusted;
  prepare::AdjustedCameras cameras;
  if (prepare::adjusts_cameras(context.capture, options)) {
    adjusted = context.capture;
    cameras = adjust(*adjusted, options, observer);
  }
  Stage1Job stage1{.capture = adjusted ? *adjusted : context.capture,
                   .options = options,
                   .snapshot = context.directory.stage1_snapshot(),
                   .resume = goes_on,
                   .points = std::move(cameras.points),
                   .moved = std::move(cameras.moved),
                   .watch = job.watch,
                   .ranks = ranks,
                   .image_memory = image_memory(context.config)};
  if (stage1.points.empty()) stage1.points = prepare::points_for_training(stage1, observer);
  return train_stage1(stage1, engines, observer);
}

}  // namespace

void train_step(const RunContext& context, const TrainJob& job, const Engines& engines, Observer& observer) {
  const RunDirectory& directory = context.directory;
  const FolderLock lock = lock_folder(directory.root(), FolderLock::Mode::kAlone, observer);
  cluster::Ranks& world = cluster::world();
  RunRecord record = directory.record();
  if (world.agreed(!record.stage1.finished || !job.resume)) {
    const bool goes_on = world.agreed(job.resume && fs::exists(directory.stage1_snapshot()));
    cluster::Ranks& ranks = ranks_that_train(engines, context.config.stage1.samples_per_step >= kSamplesWorthSharing);
    if (is_needed(ranks)) record.stage1 = {train(context, job, goes_on, ranks, engines, observer), true};
    if (world.is_first()) directory.save(record);
    world.barrier("end of stage 1");
  }
  if (!world.is_first()) return;
  observer.say(fmt::format("stage 1: {} steps in {}, {:.1f} dB on training pixels", record.stage1.steps,
                           duration_text(record.stage1.seconds), record.stage1.train_psnr));
  observer.wrote("snapshot", directory.stage1_snapshot());
}

}  // namespace cnerf::pipeline
