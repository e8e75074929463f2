#include "src/pipeline/train_step.h"

#include <fmt/format.h>

#include "src/base/text.h"
#include "src/prepare/sparse_points.h"
#include "src/train/luminance/stage1.h"

namespace cnerf::pipeline {

void train_step(const RunContext& context, const TrainJob& job, const Engines& engines, Observer& observer) {
  const RunDirectory& directory = context.directory;
  const FolderLock lock = lock_folder(directory.root(), FolderLock::Mode::kAlone, observer);
  RunRecord record = directory.record();
  if (!record.stage1.finished || !job.resume) {
    Stage1Job stage1{context.capture, context.config.stage1, directory.stage1_snapshot(), job.resume};
    stage1.points = prepare::points_for_training(stage1, observer);
    stage1.watch = job.watch;
    record.stage1 = {train_stage1(stage1, engines, observer), true};
    directory.save(record);
  }
  observer.say(fmt::format("stage 1: {} steps in {}, {:.1f} dB on training pixels", record.stage1.steps,
                           duration_text(record.stage1.seconds), record.stage1.train_psnr));
  observer.wrote("snapshot", directory.stage1_snapshot());
}

}  // namespace cnerf::pipeline
