/// The cnerf program: the one place where errors become messages and exit codes.

#include <fmt/format.h>

#include <new>

#include "src/app/command.h"
#include "src/base/error.h"
#include "src/base/progress.h"
#include "src/pipeline/version.h"

namespace cnerf::app {
namespace {

/// Words for records, which others may read: what protects the page is no part of them.
std::vector<std::string> without_token(std::vector<std::string> words) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i].starts_with("--token=")) words[i] = "--token=...";
    if (words[i] == "--token" && i + 1 < words.size()) words[++i] = "...";
  }
  return words;
}

void run_program(CLI::App& program, int argc, char** argv) {
  program.allow_extras();
  program.set_version_flag("--version", "cnerf " + pipeline::version_text());
  program.set_help_flag("-h,--help", "Show what there is");
  const std::vector<ParsedCommand> commands = declare_commands(program);
  program.parse(argc, argv);

  const ParsedCommand& chosen = chosen_command(program, commands);
  try {
    chosen.work(without_token({argv, argv + argc}));
  } catch (const Interrupted& interruption) {
    const std::string hint = chosen.command->resumable ? "; the same command with --resume goes on" : "";
    throw Interrupted(interruption.what() + hint);
  }
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
