#include "src/pipeline/colorize_step.h"

#include <fmt/format.h>

#include <optional>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/text.h"
#include "src/picture/encode.h"
#include "src/pipeline/known_color_files.h"
#include "src/pipeline/shared_training.h"
#include "src/train/chroma/stage2.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

/// "reference:a.png" -> "reference".
std::string kind_of(const std::string& spec) {
  return spec.substr(0, spec.find(':'));
}

/// The last by name of the takes that are finished, or of those that were begun; empty when there is none.
/// @param kind  of the colorizer that they are named after; empty: any
std::string last_take(const RunDirectory& directory, bool is_finished, const std::string& kind = "") {
  std::string last;
  for (const std::string& name : directory.take_names()) {
    const bool is_of_kind = kind.empty() || name == kind || name.starts_with(kind + "-");
    if (is_of_kind && directory.take_record(name).has_value() == is_finished) last = name;
  }
  return last;
}

/// Where none is named: one that was not finished, else the current one; empty where there is none.
std::string take_to_go_on_with(const RunDirectory& directory) {
  if (const std::string begun = last_take(directory, false); !begun.empty()) return begun;
  if (const std::string current = directory.record().current_take; !current.empty()) return current;
  // Killed when the take was finished and the run's record did not name it yet.
  return last_take(directory, true);
}

/// See take_to_write.
std::string chosen_take(const RunContext& context, const std::string& named, const ExistingOutput& existing) {
  check_choice(existing);
  const RunDirectory& directory = context.directory;
  if (!named.empty()) {
    check_take_name(named);
    if (directory.take_record(named) && !existing.resume && !existing.overwrite) {
      throw UsageError(directory.take_folder(named).string() +
                       ": this take is finished; pass --overwrite, or choose another --take NAME");
    }
    return named;
  }
  if (existing.resume) {
    if (const std::string take = take_to_go_on_with(directory); !take.empty()) return take;
  }
  return directory.free_take_name(kind_of(context.config.colorizer.spec));
}

/// @return  what the take's record says
TakeRecord colorize(const RunContext& context, const ColorizeJob& job, const Engines& engines, Observer& observer) {
  const RunDirectory& directory = context.directory;
  // Before anything is written: they may refuse.
  const auto [known, viewpoints] = load_known_colors(context.capture, context.config.colorizer);
  check_bases(context.config.stage2.purify, known);
  std::unique_ptr<Colorizer> made;
  if (job.colorizer == nullptr) made = colorizer_of(context, observer);
  Colorizer& colorizer = job.colorizer != nullptr ? *job.colorizer : *made;
  cluster::Ranks& world = cluster::world();
  const bool resume = world.agreed(job.existing.resume && fs::exists(directory.take_snapshot(job.take)));
  const auto keep_config = [&] { write_file(directory.take_config_file(job.take), to_toml(context.config)); };
  if (world.is_first() && !resume) {
    if (job.existing.overwrite) clear_folder(directory.take_folder(job.take));
    keep_config();
  }
  const Stage2Job stage2{context.capture,
                         directory.stage1_snapshot(),
                         context.config.stage2,
                         colorizer,
                         known,
                         directory.take_snapshot(job.take),
                         resume,
                         job.views,
                         nullptr,
                         nullptr,
                         job.watch,
                         viewpoints,
                         ranks_that_train(engines, /*pays=*/true)};
  const Stage2Report report = is_needed(stage2.ranks) ? train_stage2(stage2, engines, observer) : Stage2Report();
  if (world.is_first() && resume) keep_config();  // now that it was not refused
  observer.report_progress({"stage 2", 1.0, {}});
  return {job.take, colorizer.name() + describe(known) + describe_viewpoints(viewpoints), report};
}

}  // namespace

ColorizerContext colorizer_context(const Config& config, const fs::path& working_folder, const fs::path& cache_folder,
                                   Observer& observer) {
  const auto progress = [&observer](const Progress& fit) {
    observer.report_progress(fit);
    if (observer.is_cancelled()) throw Interrupted("stopped while fitting the reference network; nothing was kept");
  };
  return {working_folder, cache_folder, std::uint64_t(config.stage2.seed), progress,
          [&observer](const std::string& text) { observer.say(text); }};
}

std::unique_ptr<Colorizer> colorizer_of(const RunContext& context, Observer& observer) {
  // What rank 0's one learns lies in the run's cache, where the others find it.
  cluster::Ranks& world = cluster::world();
  if (!world.is_first()) world.barrier("colorizer");
  auto colorizer = make_colorizer(
      context.config.colorizer,
      colorizer_context(context.config, context.capture.root, context.directory.colorizer_cache(), observer));
  if (world.is_first()) world.barrier("colorizer");
  return colorizer;
}

std::string configured_take(const RunDirectory& directory, const std::string& named, bool resume) {
  if (!resume) return "";
  const std::string take = named.empty() ? take_to_go_on_with(directory) : named;
  std::error_code failure;  // a name that is too long is refused where it is written
  return fs::exists(directory.take_config_file(take), failure) ? take : "";  // none: killed before any was written
}

std::string take_to_write(const RunContext& context, const std::string& named, const ExistingOutput& existing) {
  cluster::Ranks& world = cluster::world();
  return world.agreed(world.is_first() ? chosen_take(context, named, existing) : "");
}

std::string take_of_run(const RunContext& context, const ExistingOutput& existing) {
  const RunDirectory& directory = context.directory;
  const std::string kind = kind_of(context.config.colorizer.spec);
  const auto chosen = [&] {
    std::string take;
    if (existing.resume) take = directory.record().current_take;
    for (const bool is_finished : {false, true}) {
      if (existing.resume && take.empty()) take = last_take(directory, is_finished, kind);
    }
    return take.empty() ? directory.free_take_name(kind) : take;
  };
  cluster::Ranks& world = cluster::world();
  return world.agreed(world.is_first() ? chosen() : "");
}

std::vector<Tile> base_candidates(const RunContext& context, ViewCache* views, const Engines& engines,
                                  Observer& observer) {
  const auto colorizer = colorizer_of(context, observer);
  const fs::path nowhere = context.directory.root() / "bases";
  return cnerf::base_candidates({context.capture,
                                 context.directory.stage1_snapshot(),
                                 context.config.stage2,
                                 *colorizer,
                                 {},
                                 nowhere,
                                 false,
                                 views},
                                engines, observer);
}

void show_bases(const RunContext& context, const Engines& engines, Observer& observer) {
  const fs::path gallery = context.directory.root() / "bases.png";
  write_png(gallery, tiled(base_candidates(context, nullptr, engines, observer)));
  observer.wrote("base candidates", gallery);
}

void colorize_step(const RunContext& context, const ColorizeJob& job, const Engines& engines, Observer& observer) {
  const RunDirectory& directory = context.directory;
  const StepLocks locks(directory, directory.take_folder(job.take), observer);
  cluster::Ranks& world = cluster::world();
  // Again, now that nobody can finish it meanwhile.
  if (world.is_first()) (void)chosen_take(context, job.take, job.existing);
  std::optional<TakeRecord> take = directory.take_record(job.take);
  if (world.agreed(!take || !job.existing.resume)) {
    take = colorize(context, job, engines, observer);
    if (world.is_first()) directory.save(*take);
  }
  if (world.is_first() && directory.record().current_take != job.take) {
    directory.update([&](RunRecord& record) { record.current_take = job.take; });
  }
  world.barrier("end of stage 2");
  if (!world.is_first()) return;
  const Stage2Report& report = take->stage2;
  observer.say(
      fmt::format("take {}: {}, {:.0f} s of them waiting for {}, {} patches accepted, {} rejected; baked colour is "
                  "{:.2f} ab from the per-pixel decode",
                  job.take, duration_text(report.seconds), report.waited_seconds, take->colorizer, report.accepted,
                  report.rejected, report.bake_ab_distance));
  observer.wrote("take", directory.take_folder(job.take));
}

}  // namespace cnerf::pipeline
