/// cnerf colorize: stage 2, one take of colours for a trained run.

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/base/absolute_folder.h"
#include "src/base/error.h"
#include "src/base/usage.h"
#include "src/cluster/ranks.h"
#include "src/pipeline/colorize_step.h"
#include "src/pipeline/default_colorizer.h"
#include "src/pipeline/key_views_step.h"
#include "src/studio/coloring.h"
#include "viewer/server/live_session.h"

namespace cnerf::app {
namespace {

struct ColorizeArguments {
  RunFolderArguments run;
  pipeline::ExistingOutput existing;
  std::string bases;
  std::string replay;
  bool bases_only = false;
  int suggested_keyframes = 0;
  bool view = false;
  web::BrowserOptions browser;
};

/// What somebody did in the studio, done again: on the processor the take is the same bit for bit.
void replay(const ColorizeArguments& arguments, const pipeline::RunContext& context, Reporter& reporter) {
  const pipeline::RunDirectory& directory = context.directory;
  const std::string of = directory.choose_take(arguments.replay);
  const studio::Journal journal =
      studio::read_journal(directory.take_folder(of) / studio::kJournalFile, paintable_views(context.capture));
  const std::string take = pipeline::take_to_write(
      context, arguments.run.take.empty() ? of + "-again" : arguments.run.take, arguments.existing);
  if (take == of || take == journal.deeds.front().base) {
    throw UsageError("--take " + take + ": is what is replayed, or was painted on; choose another name");
  }
  const FolderLock lock = pipeline::lock_folder(directory.root(), FolderLock::Mode::kShared, reporter);
  const Stopwatch watch;
  studio::Coloring coloring(context, engines_for(context.config.device));
  coloring.replay(journal, {}, [&](double fraction) {
    reporter.report_progress({"replay " + of, fraction, {}});
    if (reporter.is_cancelled()) throw Interrupted("stopped; nothing was written");
  });
  coloring.keep(take, watch.seconds(), reporter, arguments.existing.overwrite);
  reporter.wrote("take", directory.take_folder(take));
}

void suggest(const ColorizeArguments& arguments, const pipeline::RunContext& context, Reporter& reporter) {
  const std::string take = context.directory.choose_take(arguments.run.take);
  pipeline::key_views_step(context, {arguments.suggested_keyframes, take}, engines_for(context.config.device),
                           reporter);
  reporter.next("cnerf colorize " + arguments.run.run + " --keyframe VIEW=PAINTED.png");
}

void colorize(const ColorizeArguments& arguments, const std::vector<std::string>& command_line) {
  Reporter reporter = make_reporter(arguments.run.config);
  const pipeline::RunDirectory directory = pipeline::RunDirectory::open(arguments.run.run);
  const std::string base = arguments.replay.empty()
                               ? pipeline::configured_take(directory, arguments.run.take, arguments.existing.resume)
                               : directory.choose_take(arguments.replay);
  pipeline::RunContext context = open_run(arguments.run, base, command_line, reporter);
  const bool is_suggestion = arguments.suggested_keyframes > 0;
  if (!cluster::world().is_alone() && (arguments.bases_only || is_suggestion || !arguments.replay.empty())) {
    throw UsageError(
        "--bases-only, --suggest-keyframes and --replay: are for one process, without torchrun, srun or mpirun");
  }
  if (!arguments.replay.empty()) return replay(arguments, context, reporter);
  if (is_suggestion) return suggest(arguments, context, reporter);
  if (base.empty()) {
    pipeline::prefer_key_frames(named_on_command_line(arguments.run.config).colorizer, context.config.colorizer);
  }
  refuse_colorizer_of_others(arguments.run.config, context.config);
  const Engines& engines = engines_for(context.config.device);
  pipeline::choose_colorizer(context.capture, context.config, reporter);
  if (!arguments.bases.empty()) context.config.stage2.purify.picked_bases = arguments.bases;
  if (arguments.bases_only) {
    pipeline::show_bases(context, engines, reporter);
    reporter.next("cnerf colorize " + arguments.run.run + " --bases 2,5,7");
    return;
  }
  const std::string take = pipeline::take_to_write(context, arguments.run.take, arguments.existing);
  std::optional<web::LiveSession> live;
  if (arguments.view && cluster::world().is_first()) {
    live.emplace("Colorizing " + absolute_folder(context.capture.root).filename().string() + ", take " + take,
                 arguments.browser, reporter);
  }
  Observer& observer = live ? static_cast<Observer&>(*live) : reporter;
  pipeline::colorize_step(context, {take, arguments.existing}, engines, observer);
  reporter.next("cnerf bake " + arguments.run.run + " --take " + take);
}

}  // namespace

Work declare_colorize(CLI::App& app) {
  auto arguments = std::make_shared<ColorizeArguments>();
  add_run_folder_options(app, arguments->run);
  app.get_option("--take")->description(
      "Name of the take; without it a new one is named after its colorizer: reference, then reference-2");
  add_colorizer_options(app, arguments->run.config);
  app.add_option("--bases", arguments->bases,
                 "2,5,7: base images whose colours you like, by their numbers in bases.png");
  app.add_flag("--bases-only", arguments->bases_only, "Only show the candidates of base images, in a minute");
  app.add_option("--suggest-keyframes", arguments->suggested_keyframes,
                 "Only name so many views that, painted, tell most about the colours of all others")
      ->check(CLI::Range(1, 100));
  app.add_option("--replay", arguments->replay, "Make a take of the studio again from its journal, as --take NAME");
  app.add_flag("--resume", arguments->existing.resume, "Go on with a take that was stopped");
  app.add_flag("--overwrite", arguments->existing.overwrite, "Start again where a take of this name is finished");
  app.add_flag("--view", arguments->view, "Show the work in the browser, with buttons to pause and to stop");
  add_browser_options(app, arguments->browser);
  return [arguments](const auto& command_line) { colorize(*arguments, command_line); };
}

}  // namespace cnerf::app
