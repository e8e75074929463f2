/// Writes man pages and completion while cnerf is built:  cnerf-manual FOLDER DATE
/// They go to FOLDER/share, under the names that Debian's shells and man look for.

#include <cstdio>

#include "src/app/manual.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/pipeline/version.h"

namespace cnerf::app {
namespace {

void write(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  write_file(file, text);
}

void write_manual(const std::filesystem::path& share, const ManualEdition& edition) {
  CLI::App program;
  const std::vector<ParsedCommand> commands = declare_commands(program);
  write(share / "man/man1/cnerf.1", program_page(commands, edition));
  for (const ParsedCommand& each : commands) {
    write(share / "man/man1" / ("cnerf-" + std::string(each.command->name) + ".1"), command_page(each, edition));
  }
  write(share / "bash-completion/completions/cnerf", bash_completion(commands));
  write(share / "zsh/vendor-completions/_cnerf", zsh_completion(commands));
  write(share / "fish/vendor_completions.d/cnerf.fish", fish_completion(commands));
}

}  // namespace
}  // namespace cnerf::app

int main(int argc, char** argv) {
  if (argc != 3) return int(cnerf::ExitCode::kUsage);
  try {
    const std::filesystem::path share = std::filesystem::path(argv[1]) / "share";
    cnerf::app::write_manual(share, {cnerf::pipeline::version_text(), argv[2]});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cnerf-manual: %s\n", error.what());
    return int(cnerf::ExitCode::kOutput);
  }
}
