#include "src/pipeline/run.h"

#include <algorithm>
#include <chrono>
#include <future>
#include <set>
#include <utility>

#include "src/base/error.h"
#include "src/base/json_record.h"
#include "src/base/shared_observer.h"
#include "src/cluster/ranks.h"
#include "src/config/fields.h"
#include "src/config/toml_binding.h"
#include "src/evaluate/evaluate.h"
#include "src/pipeline/colorize_step.h"
#include "src/pipeline/default_colorizer.h"
#include "src/pipeline/evaluate_step.h"
#include "src/pipeline/known_color_files.h"
#include "src/pipeline/prepare_step.h"
#include "src/pipeline/render_step.h"
#include "src/pipeline/train_step.h"
#include "src/train/chroma/stage2.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

/// Outputs of an earlier, interrupted call that need not be made again.
bool is_done(const RunJob& job, const fs::path& output) {
  return cluster::world().agreed(job.existing.resume && fs::exists(output));
}

/// Rank 0 makes the capture, if that is to be made; the others wait.
fs::path common_capture(const RunJob& job, const std::string& transfer, Observer& observer) {
  cluster::Ranks& world = cluster::world();
  return world.agreed(world.is_first() ? capture_of(job.capture, job.out, transfer, observer).string() : "");
}

/// A damaged manifest is none.
exporting::Formats whole_formats_in(const fs::path& folder) {
  try {
    return exporting::formats_in(folder);
  } catch (const InputError&) {
    return {};
  }
}

/// Whether the folder has what is asked for; else also what it has is to be made again, since a bake replaces another.
bool is_baked(const RunJob& job, const fs::path& folder, exporting::Formats& formats) {
  if (!job.existing.resume) return false;
  const exporting::Formats made = whole_formats_in(folder);
  formats = formats | made;
  return cluster::world().agreed(made == formats);
}

/// Whether the run's metrics are of this take; those of another one are replaced.
bool is_evaluated(const RunJob& job, const RunDirectory& directory, const std::string& take) {
  bool are_of_take = false;
  try {
    are_of_take = job.existing.resume && read_record<Metrics>(directory.metrics_file()).take == take;
  } catch (const Error&) {  // there are none, or they are damaged
  }
  return cluster::world().agreed(are_of_take);
}

bool needs_colorizer(const RunJob& job, const RunDirectory& directory) {
  if (job.grey) return false;
  const bool is_colorized = directory.exists() && !directory.record().current_take.empty();
  return cluster::world().agreed(!(job.existing.resume && is_colorized));
}

/// The colorizer, made beside stage 1 where a GPU trains and the processor is free. What cannot be made ends the
/// training when it is known.
class ColorizerBesideTraining {
 public:
  ColorizerBesideTraining(const RunContext& context, bool is_wanted, const Engines& engines, Observer& observer) {
    if (!is_wanted) return;
    const bool is_free = engines.device() == Device::kCuda && cluster::world().is_alone();
    making_ = std::async(is_free ? std::launch::async : std::launch::deferred,
                         [&context, &observer] { return colorizer_of(context, observer); });
    // Before the training: what cannot be made or read should not cost an hour.
    if (!is_free) take();
  }
  /// To be called between steps.  @throws  as colorizer_of
  void look() {
    if (interruption_requested()) return;  // the training saves first
    if (making_.valid() && making_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) take();
  }
  [[nodiscard]] Colorizer* get() {
    if (making_.valid()) take();
    return colorizer_.get();
  }

 private:
  void take() { colorizer_ = making_.get(); }
  std::future<std::unique_ptr<Colorizer>> making_;
  std::unique_ptr<Colorizer> colorizer_;
};

/// What --resume leaves as it is.
struct MadeStep {
  std::string what;
  std::vector<std::string> sections;  ///< of its options
  std::string command;                ///< that makes it with others
};

/// Files that may have been moved since are no other options.
bool is_of(const MadeStep& step, const std::string& key) {
  static const std::set<std::string> kFiles = {"colorizer.keyframes", "colorizer.hint_images", "colorizer.hints",
                                               "colorizer.strokes"};
  return !kFiles.contains(key) && std::ranges::count(step.sections, key.substr(0, key.find('.'))) > 0;
}

std::vector<MadeStep> made_steps(const RunContext& context, const RunJob& job) {
  const RunDirectory& directory = context.directory;
  const std::string take = job.grey ? "" : take_of_run(context, job.existing);
  exporting::Formats formats = job.formats;
  const std::string run = directory.root().string();
  const std::string anew = run + " --take " + (take.empty() ? kGreyTake : take) + " --overwrite";
  std::vector<MadeStep> steps;
  if (!take.empty() && directory.take_record(take)) {
    steps.push_back({"take " + take, {"colorizer", "stage2"}, "cnerf colorize " + run + " --take NAME"});
  }
  if (is_baked(job, directory.bakes(take), formats)) {
    steps.push_back({"the bake", {"bake", "vdb", "mesh", "splat", "web", "finish"}, "cnerf bake " + anew});
  }
  if (is_done(job, directory.renders(take) / "turntable.mp4")) {
    steps.push_back({"the video", {"render", "finish"}, "cnerf render " + anew});
  }
  return steps;
}

/// Before the run's configuration is written: it keeps what finished steps were made with, and who asks for something
/// else is told.
/// @param source  the capture as it was given
void keep_made(RunContext& context, const RunJob& job, const fs::path& source, Observer& observer) {
  cluster::Ranks& world = cluster::world();
  if (!world.agreed(job.existing.resume && context.directory.exists())) return;
  const std::vector<MadeStep> steps = made_steps(context, job);
  std::vector<Field> kept;
  Observer silent;
  Config before = world.is_first() ? context.directory.config("", silent) : context.config;
  if (!job.grey && world.is_first()) choose_colorizer(source, before, silent);  // as was done with what is asked for
  const std::vector<Field> was = fields_of(before), asked = fields_of(context.config);
  for (std::size_t i = 0; i < was.size(); ++i) {
    const auto step = std::ranges::find_if(steps, [&](const MadeStep& made) { return is_of(made, was[i].key); });
    if (step == steps.end() || write_toml({was[i]}) == write_toml({asked[i]})) continue;
    observer.say("note: " + step->what + " is there and stays; " + was[i].key + " is for: " + step->command);
    kept.push_back(was[i]);
  }
  read_toml(world.agreed(write_toml(kept)), context.directory.config_file().string(), asked);
}

}  // namespace

fs::path run(RunJob job, Config config, const Engines& engines, Observer& one_observer) {
  SharedObserver observer(one_observer);
  const RunDirectory directory(job.out);
  const FolderLock lock = claim_run_folder(directory, job.existing, observer);
  if (!job.grey) choose_colorizer(job.capture, config, observer);
  const fs::path capture = common_capture(job, config.capture.transfer, observer);
  if (capture != job.capture) config.capture.transfer = "srgb";  // it was prepared of what had another
  const fs::path source = std::exchange(job.capture, capture);

  RunContext context{directory, config, read_capture(job.capture, config, observer, directory.root()),
                     job.command_line};
  if (!job.grey) {
    check_bases(config.stage2.purify, load_known_colors(context.capture, context.config.colorizer).known);
  }
  keep_made(context, job, source, observer);
  ColorizerBesideTraining colorizer(context, needs_colorizer(job, directory), engines, observer);
  begin_run(context, job.capture, job.existing);
  train_step(context, {job.existing.resume, [&](const LuminanceModel&) { colorizer.look(); }}, engines, observer);
  Colorizer* const made = colorizer.get();  // which reads the context
  use_learned_views(context, observer);

  std::string take;
  if (!job.grey) {
    take = take_of_run(context, job.existing);
    colorize_step(context, {take, job.existing, made}, engines, observer);
  }
  const fs::path bake = directory.bakes(take), renders = directory.renders(take);
  const bool was_baked = is_baked(job, bake, job.formats), was_evaluated = is_evaluated(job, directory, take),
             was_rendered = is_done(job, renders / "turntable.mp4");
  const Finish& finish = context.config.finish;
  std::unique_ptr<Scene> scene;  // of all steps that are left
  if (!was_baked || !was_evaluated || !was_rendered) scene = load_scene(directory, take, finish, engines);
  if (was_baked) {
    end_bake(directory, bake, observer);
  } else {  // first of all outputs: it is what a user waits for
    bake_step(context, {take, bake, job.formats, scene.get()}, engines, observer);
  }
  const Scene* const as_trained = finish.is_plain() ? scene.get() : nullptr;
  if (!was_evaluated) evaluate_step(context, {take, {}, false, as_trained}, engines, observer);
  if (!was_rendered) {
    const RenderOutput video{.folder = renders, .mp4 = true};
    render_step(context, {take, turntable_path(context.capture, config.render), video, scene.get()}, engines, observer);
  }
  return bake;
}

}  // namespace cnerf::pipeline
