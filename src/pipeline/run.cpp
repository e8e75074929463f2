#include "src/pipeline/run.h"

#include "src/cluster/ranks.h"
#include "src/pipeline/colorize_step.h"
#include "src/pipeline/default_colorizer.h"
#include "src/pipeline/evaluate_step.h"
#include "src/pipeline/known_color_files.h"
#include "src/pipeline/prepare_step.h"
#include "src/pipeline/render_step.h"
#include "src/pipeline/train_step.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

/// Outputs of an earlier, interrupted call that need not be made again.
bool is_done(const RunJob& job, const fs::path& output) {
  return cluster::world().agreed(job.existing.resume && fs::exists(output));
}

/// Rank 0 makes the capture, if that is to be made; the others wait.
fs::path common_capture(const RunJob& job, Observer& observer) {
  cluster::Ranks& world = cluster::world();
  return world.agreed(world.is_first() ? capture_of(job.capture, job.out, observer).string() : "");
}

bool needs_colorizer(const RunJob& job, const RunDirectory& directory) {
  if (job.grey) return false;
  const bool is_colorized = directory.exists() && !directory.record().current_take.empty();
  return cluster::world().agreed(!(job.existing.resume && is_colorized));
}

}  // namespace

fs::path run(RunJob job, Config config, const Engines& engines, Observer& observer) {
  const RunDirectory directory(job.out);
  const FolderLock lock = claim_run_folder(directory, job.existing, observer);
  if (!job.grey) choose_colorizer(job.capture, config, observer);
  job.capture = common_capture(job, observer);

  RunContext context{directory, config, read_capture(job.capture, config, observer, directory.root()),
                     job.command_line};
  // Made before the training: what cannot be made or read should not cost an hour.
  if (!job.grey) (void)load_known_colors(context.capture, context.config.colorizer);
  const auto colorizer = needs_colorizer(job, directory) ? colorizer_of(context, observer) : nullptr;
  begin_run(context, job.capture, job.existing);
  train_step(context, {job.existing.resume}, engines, observer);
  use_learned_views(context, observer);

  std::string take;
  if (!job.grey) {
    take = take_to_write(context, "", job.existing);
    colorize_step(context, {take, job.existing, colorizer.get()}, engines, observer);
  }
  const fs::path bake = directory.bakes(take);  // first of all outputs: it is what a user waits for
  if (is_done(job, last_file(bake, job.formats))) {
    end_bake(directory, bake, observer);
  } else {
    bake_step(context, {take, bake, job.formats}, engines, observer);
  }
  if (!is_done(job, directory.metrics_file())) evaluate_step(context, {take, {}}, engines, observer);
  const fs::path renders = directory.renders(take);
  if (!is_done(job, renders / "turntable.mp4")) {
    const RenderOutput video{.folder = renders, .mp4 = true};
    render_step(context, {take, turntable_path(context.capture, config.render), video}, engines, observer);
  }
  return bake;
}

}  // namespace cnerf::pipeline
