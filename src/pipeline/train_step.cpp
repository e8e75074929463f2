#include "src/pipeline/train_step.h"

#include <fmt/format.h>

#include "src/base/text.h"
#include "src/pipeline/shared_training.h"
#include "src/prepare/sparse_points.h"
#include "src/train/luminance/stage1.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;

void train_step(const RunContext& context, const TrainJob& job, const Engines& engines, Observer& observer) {
  const RunDirectory& directory = context.directory;
  const FolderLock lock = lock_folder(directory.root(), FolderLock::Mode::kAlone, observer);
  cluster::Ranks& world = cluster::world();
  RunRecord record = directory.record();
  if (world.agreed(!record.stage1.finished || !job.resume)) {
    const bool goes_on = job.resume && fs::exists(directory.stage1_snapshot());
    Stage1Job stage1{.capture = context.capture,
                     .options = context.config.stage1,
                     .snapshot = directory.stage1_snapshot(),
                     .resume = world.agreed(goes_on),
                     .watch = job.watch,
                     .ranks = ranks_that_train(engines, context.config.stage1.samples_per_step >= kSamplesWorthSharing),
                     .image_memory = image_memory(context.config)};
    if (is_needed(stage1.ranks)) {
      stage1.points = prepare::points_for_training(stage1, observer);
      record.stage1 = {train_stage1(stage1, engines, observer), true};
    }
    if (world.is_first()) directory.save(record);
    world.barrier("end of stage 1");
  }
  if (!world.is_first()) return;
  observer.say(fmt::format("stage 1: {} steps in {}, {:.1f} dB on training pixels", record.stage1.steps,
                           duration_text(record.stage1.seconds), record.stage1.train_psnr));
  observer.wrote("snapshot", directory.stage1_snapshot());
}

}  // namespace cnerf::pipeline
