#include "src/app/pipeline.h"

#include <fmt/format.h>

#include <algorithm>

#include "src/app/known_color_files.h"
#include "src/app/version.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/text.h"
#include "src/capture/load_capture.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

bool holds_something(const fs::path& folder) {
  std::error_code failure;
  return fs::exists(folder, failure) && (!fs::is_directory(folder, failure) || !fs::is_empty(folder, failure));
}

/// "reference:a.png" -> "reference".
std::string kind_of(const std::string& spec) {
  return spec.substr(0, spec.find(':'));
}

/// A take that was begun and not finished; empty when there is none.
std::string unfinished_take(const RunDirectory& directory) {
  std::vector<std::string> names;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(directory.root() / "takes", failure)) {
    const std::string name = entry.path().filename().string();
    if (!directory.take_record(name)) names.push_back(name);
  }
  std::ranges::sort(names);
  return names.empty() ? "" : names.back();
}

}  // namespace

Capture read_capture(const fs::path& path, const Config& config, Reporter& reporter) {
  Capture capture = load_capture(path, config.capture);
  const auto held_out = std::ranges::count_if(capture.views, [](const View& view) { return view.held_out; });
  const Intrinsics& first = capture.views.front().intrinsics;
  reporter.say(fmt::format("capture: {} ({}, {} views of {} x {}, {} held out)", path.string(), capture.format,
                           capture.views.size(), first.width, first.height, held_out));
  for (const std::string& note : capture.notes) reporter.say("note: " + note);
  return capture;
}

void check_run_folder(const RunDirectory& directory, const ExistingOutput& existing) {
  const fs::path& root = directory.root();
  if (directory.exists()) {
    if (existing.resume || existing.overwrite) return;
    throw UsageError(root.string() +
                     ": holds a run already; pass --resume to go on with it or --overwrite to start again");
  }
  if (holds_something(root)) {
    throw UsageError(root.string() + ": is not empty and holds no run; choose another folder");
  }
}

void begin_run(const RunContext& context, const fs::path& capture_path, const ExistingOutput& existing) {
  const RunDirectory& directory = context.directory;
  const bool goes_on = directory.exists() && existing.resume;
  if (directory.exists() && !goes_on) directory.clear();
  // Before the configuration is written: what is refused must not take the place of what the run was made with.
  if (goes_on && !directory.record().stage1_finished) {
    check_continues(directory.stage1_snapshot(), context.config.stage1);
  }
  write_file(directory.config_file(), to_toml(context.config));
  if (goes_on) return;
  RunRecord record;
  record.capture = fs::absolute(capture_path).lexically_normal();
  record.program_version = version_text();
  record.command_line = joined(context.command_line);
  directory.save(record);
}

ColorizerOptions colorizer_options(const Config& config, const fs::path& working_folder, const fs::path& cache_folder,
                                   Reporter& reporter) {
  ColorizerOptions options;
  options.spec = config.colorizer.spec;
  options.prompt = config.colorizer.prompt;
  options.working_folder = working_folder;
  options.timeout_seconds = config.colorizer.timeout_seconds;
  options.reference_steps = config.colorizer.reference_steps;
  options.reference_on_builtin = config.colorizer.reference_on_builtin;
  options.seed = std::uint64_t(config.stage2.seed);
  options.cache_folder = cache_folder;
  options.progress = reporter.progress_sink();
  return options;
}

std::unique_ptr<Colorizer> colorizer_of(const RunContext& context) {
  return make_colorizer(
      colorizer_options(context.config, context.capture.root, context.directory.colorizer_cache(), context.reporter));
}

void train_step(RunContext& context, bool resume) {
  const RunDirectory& directory = context.directory;
  RunRecord record = directory.record();
  if (!record.stage1_finished || !resume) {
    record.stage1 = train_stage1({context.capture, context.config.stage1, directory.stage1_snapshot(), resume},
                                 context.engines, context.training_observer());
    record.stage1_finished = true;
    directory.save(record);
  }
  context.reporter.say(fmt::format("stage 1: {} steps in {}, {:.1f} dB on training pixels", record.stage1.steps,
                                   duration_text(record.stage1.seconds), record.stage1.train_psnr));
  context.reporter.wrote("snapshot", directory.stage1_snapshot());
}

std::string take_to_write(const RunContext& context, const std::string& named, const ExistingOutput& existing) {
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
    if (const std::string unfinished = unfinished_take(directory); !unfinished.empty()) return unfinished;
    if (const std::string current = directory.record().current_take; !current.empty()) return current;
  }
  return directory.free_take_name(kind_of(context.config.colorizer.spec));
}

void show_bases(const RunContext& context) {
  const RunDirectory& directory = context.directory;
  const fs::path gallery = directory.root() / "bases.png";
  const auto colorizer = colorizer_of(context);
  write_base_candidates({context.capture, directory.stage1_snapshot(), context.config.stage2, *colorizer, {}, gallery},
                        context.engines, context.reporter);
  context.reporter.wrote("base candidates", gallery);
  context.reporter.next("cnerf colorize " + directory.root().string() + " --bases 2,5,7");
}

void colorize_step(RunContext& context, const std::string& take, const ExistingOutput& existing,
                   std::unique_ptr<Colorizer> colorizer) {
  const RunDirectory& directory = context.directory;
  std::optional<TakeRecord> finished = directory.take_record(take);
  if (!finished || !existing.resume) {
    // Before anything is written: they may refuse.
    const std::vector<KnownColors> known = load_known_colors(context.capture, context.config.colorizer);
    if (!colorizer) colorizer = colorizer_of(context);
    if (existing.overwrite) fs::remove_all(directory.take_folder(take));
    write_file(directory.take_config_file(take), to_toml(context.config));
    const Stage2Report report = train_stage2({context.capture, directory.stage1_snapshot(), context.config.stage2,
                                              *colorizer, known, directory.take_snapshot(take), existing.resume},
                                             context.engines, context.training_observer());
    context.training_observer().report_progress({"stage 2", 1.0, {}});
    finished = TakeRecord{take, colorizer->name() + describe(known), report};
    directory.save(*finished);
    RunRecord record = directory.record();
    record.current_take = take;
    directory.save(record);
  }
  const Stage2Report& report = finished->stage2;
  context.reporter.say(
      fmt::format("take {}: {}, {:.0f} s of them waiting for {}, {} patches accepted, {} rejected; baked colour is "
                  "{:.2f} ab from the per-pixel decode",
                  take, duration_text(report.seconds), report.waited_seconds, finished->colorizer, report.accepted,
                  report.rejected, report.bake_ab_distance));
  context.reporter.wrote("take", directory.take_folder(take));
}

RenderOptions render_options(const Config& config) {
  RenderOptions options;
  options.steps_per_box = config.render.steps_per_box;
  options.min_transmittance = config.render.min_transmittance;
  return options;
}

}  // namespace cnerf
