/// The cnerf program: the one place where errors become messages and exit codes.

#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <exception>
#include <filesystem>
#include <new>
#include <system_error>

#include "src/app/command.h"
#include "src/base/error.h"
#include "src/base/progress.h"
#include "src/base/text.h"
#include "src/cluster/ranks.h"
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

/// What holds for every word: names go into JSON, glTF and VDB files, which hold UTF-8.
void check_words(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    if (!is_utf8(argv[i])) throw UsageError("expected words in UTF-8, found '" + printable(argv[i]) + "'");
  }
}

/// The same of the folder that relative names are of.
void check_working_folder() {
  std::error_code failure;  // where it is gone, who uses it says so
  const std::string folder = std::filesystem::current_path(failure).string();
  if (is_utf8(folder)) return;
  throw UsageError("expected a working folder whose name is in UTF-8, found '" + printable(folder) +
                   "'; call cnerf from another one");
}

/// Libraries say by their own exceptions that memory did not suffice.
bool is_shortage_of_memory(const std::exception& error) {
  const std::string text = error.what();
  const auto has = [&](const char* words) { return text.find(words) != std::string::npos; };
  const auto* system = dynamic_cast<const std::system_error*>(&error);
  const bool has_no_thread = system != nullptr && system->code() == std::errc::resource_unavailable_try_again;
  return dynamic_cast<const std::bad_alloc*>(&error) != nullptr || has_no_thread || has("can't allocate memory") ||
         has("not enough memory") || has("Insufficient memory") || has("Failed to allocate") ||
         has("pthread_create has failed") || has("malloc failed");
}

constexpr const char* kOutOfMemory = "error: out of memory; a larger --downscale or a smaller preset needs less";

/// Threads and initialisers of libraries have nobody to pass a shortage of memory on to. What else ends here is a
/// crash.
[[noreturn]] void end_without_handler() {
  try {
    if (const std::exception_ptr error = std::current_exception()) std::rethrow_exception(error);
  } catch (const std::exception& error) {
    if (is_shortage_of_memory(error)) {
      std::fprintf(stderr, "\ncnerf: %s\n", kOutOfMemory);
      std::_Exit(int(ExitCode::kMemory));
    }
    std::fprintf(stderr, "\ncnerf: internal error, please report it: %s\n", error.what());
  } catch (...) {
  }
  std::abort();
}

void run_program(CLI::App& program, int argc, char** argv) {
  check_words(argc, argv);
  program.allow_extras();
  program.set_version_flag("--version", "cnerf " + pipeline::version_text());
  const std::vector<ParsedCommand> commands = declare_commands(program);
  program.parse(argc, argv);
  check_working_folder();

  const ParsedCommand& chosen = chosen_command(program, commands);
  if (chosen.command->shared) cluster::join_world();
  try {
    chosen.work(without_token({argv, argv + argc}));
  } catch (const Interrupted& interruption) {
    if (!chosen.command->resumable) throw;
    const bool overwrites = chosen.app->count("--overwrite") > 0;  // which --resume contradicts
    throw Interrupted(std::string(interruption.what()) + "; the same command with --resume" +
                      (overwrites ? " instead of --overwrite" : "") + " goes on");
  }
}

/// On a terminal only, and not where NO_COLOR asks for none (no-color.org).
bool wants_color(std::FILE* out) {
  const char* none = std::getenv("NO_COLOR");
  return ::isatty(::fileno(out)) != 0 && (none == nullptr || *none == '\0');
}

/// Of several processes each says which it is.
std::string with_rank(const std::string& message) {
  const cluster::Ranks& world = cluster::world();
  return world.is_alone() ? message : "rank " + std::to_string(world.rank()) + ": " + message;
}

int failed(ExitCode code, const std::string& message) {
  constexpr const char* kRed = "\x1b[31m";
  constexpr const char* kNormal = "\x1b[0m";
  const bool is_red = wants_color(stderr);
  fmt::print(stderr, "\n{}cnerf: {}{}\n", is_red ? kRed : "", with_rank(message), is_red ? kNormal : "");
  cluster::leave_world(message);
  return int(code);
}

int guarded_main(int argc, char** argv) {
  std::set_terminate(end_without_handler);
  CLI::App program{"Colour volumes from monochrome photographs or film clips", "cnerf"};
  try {
    run_program(program, argc, argv);
    cluster::leave_world({});
    return int(ExitCode::kSuccess);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return program.exit(error);  // --help, --version
    return failed(ExitCode::kUsage, error.what());
  } catch (const Interrupted& error) {
    return failed(error.exit_code(), error.what());
  } catch (const Error& error) {
    return failed(error.exit_code(), std::string("error: ") + error.what());
  } catch (const std::filesystem::filesystem_error& error) {
    return failed(exit_code_of(error), "error: " + error.path1().string() + ": " + error.code().message());
  } catch (const std::exception& error) {
    if (is_shortage_of_memory(error)) return failed(ExitCode::kMemory, kOutOfMemory);
    return failed(ExitCode::kInternal, std::string("internal error, please report it: ") + error.what());
  }
}

}  // namespace
}  // namespace cnerf::app

int main(int argc, char** argv) {
  cnerf::install_interruption_handler();
  const int code = cnerf::app::guarded_main(argc, argv);
  std::fflush(nullptr);
  // A network that gave no answer in time may still be computing, in a thread that cannot be stopped; and those that
  // talk with other processes may wait for ever.
  if (code == int(cnerf::ExitCode::kColorizer) || !cnerf::cluster::world().is_alone()) std::_Exit(code);
  return code;
}
