/// cnerf compare: the paper's table, its baselines and ablations.

#include <algorithm>
#include <array>
#include <functional>
#include <utility>

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/text.h"
#include "src/cluster/ranks.h"
#include "src/compare/baselines/simulated.h"
#include "src/compare/rating.h"
#include "src/compare/run.h"
#include "src/pipeline/run_context.h"

namespace cnerf::app {
namespace fs = std::filesystem;
using namespace compare;
namespace {

struct CompareArguments {
  ConfigArguments config;
  std::vector<std::string> captures, ratings;
  std::string out, methods = "all", lpips_weights, style_reference, clip, clip_text;
  int seeds = 1, first_seed = 1;
  bool rating_sheet = false, resume = false, overwrite = false, only_report = false;
};

/// @throws UsageError  only a part of it was given
TextGuide text_guide_of(const CompareArguments& arguments) {
  if (arguments.clip.empty() && arguments.clip_text.empty()) return {};
  const std::size_t comma = arguments.clip.find(',');
  if (comma == std::string::npos || arguments.clip_text.empty()) {
    throw UsageError("--clip: expected IMAGE.pt,TEXT.pt, and a text by --clip-text; got \"" + arguments.clip +
                     "\" and \"" + arguments.clip_text + "\"");
  }
  TextGuide guide{arguments.clip.substr(0, comma), arguments.clip.substr(comma + 1), arguments.clip_text};
  for (const fs::path& file : {guide.image_encoder, guide.text_encoder}) {
    if (!fs::exists(file)) throw MissingInputError("--clip: " + file.string() + ": no such file");
  }
  return guide;
}

/// Methods are compared by what they make of a colorizer's answers.  @throws UsageError  colours are known
void refuse_known_colors(const ColorizerOptions& colorizer) {
  const std::array<std::pair<const char*, const std::string*>, 5> known = {{{"keyframes", &colorizer.keyframes},
                                                                            {"hints", &colorizer.hints},
                                                                            {"hint_images", &colorizer.hint_images},
                                                                            {"palette", &colorizer.palette},
                                                                            {"strokes", &colorizer.strokes}}};
  for (const auto& [key, value] : known) {
    if (!value->empty()) throw UsageError(std::string("colorizer.") + key + ": no method of a comparison is shown it");
  }
}

void run_comparison(CompareArguments arguments, const std::vector<std::string>& command_line) {
  Reporter reporter = make_reporter(arguments.config);
  const fs::path first = arguments.captures.empty() ? "cnerf" : parse_compared_capture(arguments.captures.front()).path;
  arguments.out = chosen_output(arguments.out, output_beside(first, "comparison"), reporter).string();
  if (!arguments.ratings.empty()) {
    return write_ratings(arguments.out, {arguments.ratings.begin(), arguments.ratings.end()}, reporter);
  }
  if (arguments.captures.empty()) throw UsageError("CAPTURE: at least one is needed");
  if (arguments.only_report && arguments.overwrite) {
    throw UsageError("--overwrite: there would be nothing left for --only-report");
  }
  Config config = resolve_config(arguments.config);
  refuse_known_colors(config.colorizer);
  if (config.colorizer.spec.empty()) {
    config.colorizer.spec = kSimulated;
    reporter.say("no --colorizer given: a simulated one disturbs the true colours (docs/evaluation.md)");
  }
  Plan plan;
  for (const std::string& text : arguments.captures) plan.captures.push_back(parse_compared_capture(text));
  plan.only_report = arguments.only_report;
  plan.report = arguments.out;
  plan.methods = parse_methods(arguments.methods);
  for (int i = 0; i < arguments.seeds; ++i) plan.seeds.push_back(arguments.first_seed + i);
  plan.lpips_weights = arguments.lpips_weights;
  plan.style_reference = arguments.style_reference;
  plan.text = text_guide_of(arguments);
  // Nobody has its networks but who names them.
  if (arguments.methods == "all" && plan.text.text.empty())
    std::erase_if(plan.methods, std::mem_fn(&Method::follows_text));
  plan.command_line = joined(command_line);
  pipeline::check_choice({.resume = arguments.resume, .overwrite = arguments.overwrite});
  // Parts with other seeds may run side by side.
  const auto mode = arguments.overwrite ? FolderLock::Mode::kAlone : FolderLock::Mode::kShared;
  const FolderLock lock = pipeline::lock_folder(plan.report, mode, reporter);
  cluster::Ranks& world = cluster::world();
  Run comparison(std::move(plan), config, reporter);  // before anything is cleared: it may refuse
  if (world.is_first()) {
    begin_report(arguments.out, {arguments.resume || arguments.only_report, arguments.overwrite});
  }
  world.barrier("begin of the comparison");
  if (world.is_first()) write_file(fs::path(arguments.out) / "config.toml", to_toml(config));
  comparison.run();
  if (!world.is_first()) return;
  comparison.write_report();
  if (arguments.rating_sheet) comparison.write_rating_sheet();
  reporter.next("open " + (fs::path(arguments.out) / "report.html").string() + " in a browser");
}

}  // namespace

Work declare_compare(CLI::App& app) {
  auto arguments = std::make_shared<CompareArguments>();
  app.add_option("CAPTURE", arguments->captures,
                 "Folders of colour photographs and camera poses; FOLDER@4: image sizes divided by 4");
  app.add_option("-o,--out", arguments->out,
                 "Folder of the report, made if needed; CAPTURE-comparison of the first one if not given");
  app.add_option("--methods", arguments->methods, "Names of methods, comma-separated, or all [all]");
  app.add_option("--seeds", arguments->seeds, "How often everything is repeated, with seeds 1, 2, ... [1]")
      ->check(CLI::Range(1, 100));
  app.add_option("--first-seed", arguments->first_seed, "Where the seeds begin, for parts that run side by side [1]")
      ->check(CLI::Range(1, 1000000));
  app.add_option("--lpips-weights", arguments->lpips_weights, "LPIPS weights (X_f32.bin beside X_manifest.txt)");
  app.add_flag("--rating-sheet", arguments->rating_sheet, "Also write a page on which people judge unnamed pictures");
  app.add_option("--ratings", arguments->ratings, "Only make a table of these files of answers to the rating sheet");
  add_short_form(app, arguments->config, "--colorizer", "colorizer.spec");
  add_short_form(app, arguments->config, "--prompt", "colorizer.prompt");
  CLI::Option* colorizer = app.get_option("--colorizer");
  colorizer->description(colorizer->get_description() +
                         "; simulated if not given: the true colours, disturbed on purpose");
  app.add_option("--style-reference", arguments->style_reference,
                 "Image whose style is transferred [the middle training view, coloured by the colorizer]");
  app.add_option("--clip", arguments->clip, "Encoders of images and of texts as TorchScript, IMAGE.pt,TEXT.pt");
  app.add_option("--clip-text", arguments->clip_text, "What the method clip-nerf makes pictures look like");
  add_short_form(app, arguments->config, "--downscale", "capture.downscale");
  add_short_form(app, arguments->config, "--holdout", "capture.holdout");
  app.add_flag("--resume", arguments->resume, "Go on with a comparison; what is finished and unchanged stays");
  app.add_flag("--only-report", arguments->only_report, "Train nothing; make the report of what is there");
  app.add_flag("--overwrite", arguments->overwrite, "Start again where a comparison is already");
  add_config_options(app, arguments->config);
  return [arguments](const auto& command_line) { run_comparison(*arguments, command_line); };
}

}  // namespace cnerf::app
