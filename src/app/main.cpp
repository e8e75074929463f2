/// The cnerf program: a table of commands, and the one place where errors become messages and exit codes.

#include <fmt/format.h>

#include <algorithm>
#include <new>

#include "src/app/command.h"
#include "src/base/error.h"
#include "src/base/progress.h"
#include "src/config/toml_binding.h"
#include "src/pipeline/version.h"

namespace cnerf::app {
namespace {

constexpr Command kCommands[] = {
    {"run", "All of the below: train, colorize, evaluate, bake, render", declare_run, true},
    {"sample", "Write the embedded sample capture, with colour ground truth", declare_sample, false},
    {"prepare", "Photographs or a film clip to a capture: camera poses by COLMAP", declare_prepare, true},
    {"train", "Stage 1: luminance and density from a capture", declare_train, true},
    {"colorize", "Stage 2: colours for a trained run; takes stand side by side", declare_colorize, true},
    {"colorize-image", "One picture, to judge a colorizer", declare_colorize_image, false},
    {"render", "Pictures and videos of a run", declare_render, false},
    {"eval", "Numbers against held-out views, and a contact sheet", declare_eval, false},
#if CNERF_COMPARE
    {"compare", "The paper's method, its ablations and baselines, in one table", declare_compare, true},
#endif
    {"bake", "A run as an OpenVDB volume for Blender and others", declare_bake, false},
    {"view", "A bake or a run in the browser", declare_view, false},
    {"info", "What a capture, run, snapshot or VDB holds", declare_info, false},
    {"doctor", "What this machine and build can do", declare_doctor, false},
};

struct ParsedCommand {
  const Command* command;
  CLI::App* app;
  Work work;
};

std::vector<ParsedCommand> declare_commands(CLI::App& program) {
  std::vector<ParsedCommand> commands;
  for (const Command& command : kCommands) {
    CLI::App* app = program.add_subcommand(command.name, command.summary);
    app->allow_extras();  // unknown words are refused below, with a suggestion
    commands.push_back({&command, app, command.declare(*app)});
  }
  return commands;
}

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

void run_program(CLI::App& program, int argc, char** argv) {
  program.allow_extras();
  program.set_version_flag("--version", "cnerf " + pipeline::version_text());
  program.set_help_flag("-h,--help", "Show what there is");
  const std::vector<ParsedCommand> commands = declare_commands(program);
  program.parse(argc, argv);

  const std::vector<std::string> words(argv, argv + argc);
  for (const ParsedCommand& each : commands) {
    if (!each.app->parsed()) continue;
    refuse_unknown_words(*each.app);
    try {
      return each.work(words);
    } catch (const Interrupted& interruption) {
      const std::string hint = each.command->resumable ? "; the same command with --resume goes on" : "";
      throw Interrupted(interruption.what() + hint);
    }
  }
  if (!program.remaining().empty()) refuse_unknown_command(program.remaining().front());
  throw UsageError("a command is needed\n\n" + program.help());
}

int failed(ExitCode code, const std::string& message) {
  fmt::print(stderr, "\ncnerf: {}\n", message);
  return int(code);
}

int guarded_main(int argc, char** argv) {
  CLI::App program{"Colour volumes from monochrome photographs with known camera poses", "cnerf"};
  try {
    run_program(program, argc, argv);
    return int(ExitCode::kSuccess);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return program.exit(error);  // --help, --version
    return failed(ExitCode::kUsage, error.what());
  } catch (const Interrupted& error) {
    return failed(error.exit_code(), error.what());
  } catch (const Error& error) {
    return failed(error.exit_code(), std::string("error: ") + error.what());
  } catch (const std::bad_alloc&) {
    return failed(ExitCode::kDevice, "error: out of memory; a larger --downscale or a smaller preset needs less");
  } catch (const std::exception& error) {
    return failed(ExitCode::kInternal, std::string("internal error, please report it: ") + error.what());
  }
}

}  // namespace
}  // namespace cnerf::app

int main(int argc, char** argv) {
  cnerf::install_interruption_handler();
  return cnerf::app::guarded_main(argc, argv);
}
