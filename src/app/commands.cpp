#include "src/app/command.h"
#include "src/app/exit_codes.h"
#include "src/base/error.h"
#include "src/config/toml_binding.h"

namespace cnerf::app {
namespace {

constexpr Command kCommands[] = {
    {"run",
     "Everything in one go: train, colorize, bake, evaluate, render",
     declare_run,
     true,
     true,
     {"cnerf run photos -o out/photos --preset quick", "cnerf run clip.mp4 --colorizer reference:painted_view.jpg"}},
    {"sample",
     "Write the embedded sample capture, with colour ground truth",
     declare_sample,
     false,
     false,
     {"cnerf sample", "cnerf sample -o capture --overwrite"}},
    {"prepare",
     "Photographs or a film clip to a capture: camera poses by COLMAP",
     declare_prepare,
     true,
     false,
     {"cnerf prepare clip.mp4 -o captures/street", "cnerf prepare photos --motion-masks"}},
    {"train",
     "Stage 1: luminance and density from a capture",
     declare_train,
     true,
     true,
     {"cnerf train photos -o out/photos --preset quality --holdout 8", "cnerf train photos -o out/photos --resume"}},
    {"colorize",
     "Stage 2: colours for a trained run; takes stand side by side",
     declare_colorize,
     true,
     true,
     {"cnerf colorize out/photos --take warm --colorizer reference:warm.jpg",
      "cnerf colorize out/photos --keyframe IMG_0012=painted.png --hint 412,230,IMG_0020,#8a2be2"}},
    {"colorize-image",
     "One picture, to judge a colorizer",
     declare_colorize_image,
     false,
     false,
     {"cnerf colorize-image grey.png coloured.png",
      "cnerf colorize-image grey.png coloured.png --colorizer reference:warm.jpg"}},
    {"render",
     "Pictures and videos of a run",
     declare_render,
     false,
     true,
     {"cnerf render out/photos --take warm --path orbit --format mp4,png",
      "cnerf render out/photos --photographs --views IMG_0012,IMG_0020"}},
    {"eval",
     "Numbers against held-out views, and a contact sheet",
     declare_eval,
     false,
     true,
     {"cnerf eval out/photos", "cnerf eval out/photos --take warm"}},
    {"report",
     "Many runs in one table and one contact sheet",
     declare_report,
     false,
     false,
     {"cnerf report runs/fox runs/flower", "cnerf report runs/fox runs/flower -o table --overwrite"}},
#if CNERF_COMPARE
    {"compare",
     "The paper's method, its ablations and baselines, in one table",
     declare_compare,
     true,
     true,
     {"cnerf compare photos -o out/table --seeds 3", "cnerf compare fox@4 trex@8 --methods all --rating-sheet"}},
#endif
    {"bake",
     "A run as an OpenVDB volume for Blender and others",
     declare_bake,
     false,
     true,
     {"cnerf bake out/photos --take warm --resolution 384", "cnerf bake out/photos --format vdb,gltf,exr -o out/warm"}},
    {"view",
     "A bake or a run in the browser",
     declare_view,
     false,
     false,
     {"cnerf view out/photos", "cnerf view out/photos --take warm --port 0 --no-browser"}},
    {"studio",
     "A run painted and coloured in the browser",
     declare_studio,
     false,
     false,
     {"cnerf studio photos -o out/photos", "cnerf studio out/photos --take warm"}},
    {"info",
     "What a capture, run, snapshot or VDB holds",
     declare_info,
     false,
     false,
     {"cnerf info photos", "cnerf info out/photos/bakes/warm/volume.vdb"}},
    {"doctor",
     "What this machine and build can do",
     declare_doctor,
     false,
     false,
     {"cnerf doctor", "cnerf doctor --quiet"}},
};

void refuse_unknown_command(const std::string& word) {
  std::vector<std::string> names;
  for (const Command& command : kCommands) names.emplace_back(command.name);
  const std::string meant = nearest_name(word, names);
  throw UsageError("unknown command '" + word + "'" + (meant.empty() ? "" : "; did you mean '" + meant + "'?"));
}

void refuse_unknown_words(const CLI::App& app) {
  const std::vector<std::string> words = app.remaining();
  if (words.empty()) return;
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) names.push_back(option->get_name());
  const std::string meant = nearest_name(words.front(), names);
  throw UsageError("unexpected '" + words.front() + "'" + (meant.empty() ? "" : "; did you mean '" + meant + "'?") +
                   " (cnerf " + app.get_name() + " --help lists the options)");
}

/// What an unset variable of a shell leaves: a folder of no name would be the one the user stands in.
void refuse_empty_values(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& value : option->results()) {
      if (value.empty() && option->get_name() != "--prompt") {
        throw UsageError(option->get_name(true) + ": expected a value, found nothing between the quotes");
      }
    }
  }
}

}  // namespace

std::vector<ParsedCommand> declare_commands(CLI::App& program) {
  program.set_help_flag("-h,--help", "Show what there is");
  program.footer(exit_codes_text());
  program.require_subcommand(0, 1);  // behind a command, `run` or `sample` is the name of a folder
  std::vector<ParsedCommand> commands;
  for (const Command& command : kCommands) {
    CLI::App* app = program.add_subcommand(command.name, command.summary);
    app->allow_extras();  // unknown words are refused below, with a suggestion
    app->footer(std::string("Examples:\n  ") + command.examples[0] + "\n  " + command.examples[1] + "\n");
    commands.push_back({&command, app, command.declare(*app)});
  }
  return commands;
}

const ParsedCommand& chosen_command(const CLI::App& program, const std::vector<ParsedCommand>& commands) {
  for (const ParsedCommand& each : commands) {
    if (!each.app->parsed()) continue;
    refuse_unknown_words(*each.app);
    refuse_empty_values(*each.app);
    return each;
  }
  if (!program.remaining().empty()) refuse_unknown_command(program.remaining().front());
  throw UsageError("a command is needed\n\n" + program.help());
}

}  // namespace cnerf::app
