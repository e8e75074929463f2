#include "src/app/run_arguments.h"

#include "src/base/absolute_folder.h"
#include "src/base/error.h"

namespace cnerf::app {
namespace fs = std::filesystem;

void add_run_folder_options(CLI::App& app, RunFolderArguments& arguments) {
  app.add_option("RUN", arguments.run, "Folder of a run")->required();
  app.add_option("--capture", arguments.capture, "Where the capture lies now, if it was moved");
  app.add_option("--take", arguments.take, "Name of a colorization; the last one if not given");
  add_config_options(app, arguments.config);
}

pipeline::RunContext open_run(const RunFolderArguments& arguments, const std::string& take,
                              std::vector<std::string> command_line, Reporter& reporter) {
  const pipeline::RunRecord record = pipeline::RunDirectory::open(arguments.run).record();
  if (!record.stage1.finished) {
    throw MissingInputError(arguments.run + ": stage 1 is not finished; go on with: cnerf train " +
                            record.capture.string() + " -o " + arguments.run + " --resume");
  }
  return open_begun_run(arguments, take, std::move(command_line), reporter);
}

pipeline::RunContext open_begun_run(const RunFolderArguments& arguments, const std::string& take,
                                    std::vector<std::string> command_line, Reporter& reporter) {
  pipeline::RunDirectory directory = pipeline::RunDirectory::open(arguments.run);
  const pipeline::RunRecord record = directory.record();
  Config config = resolve_config(arguments.config, directory.config(take, reporter));
  const bool is_told = !arguments.capture.empty();
  Capture capture = [&] {
    try {
      return pipeline::read_capture(is_told ? fs::path(arguments.capture) : record.capture, config, reporter,
                                    directory.root());
    } catch (const Error& error) {
      const ExitCode code = error.exit_code();
      if (is_told || (code != ExitCode::kMissingInput && code != ExitCode::kInput)) throw;
      throw Error(
          code, directory.record_file().string() + ": capture: " + error.what() + "; --capture says where it lies now");
    }
  }();
  pipeline::RunContext context{std::move(directory), std::move(config), std::move(capture), std::move(command_line)};
  if (record.stage1.finished) pipeline::use_learned_views(context, reporter);
  return context;
}

fs::path output_beside(const fs::path& source, const std::string& kind) {
  const fs::path plain = absolute_folder(source);
  std::error_code failure;  // what is missing is refused where it is read
  // A folder's name may have dots of its own.
  const fs::path name = fs::is_directory(plain, failure) ? plain.filename() : plain.stem();
  return plain.parent_path() / (name.string() + "-" + kind);
}

fs::path chosen_output(const fs::path& given, const fs::path& fallback, Reporter& reporter) {
  if (!given.empty()) return given;
  reporter.say("no -o given: writing to " + fallback.string());
  return fallback;
}

void refuse_existing(const fs::path& output, bool overwrite) {
  std::error_code failure;  // what cannot be looked at is refused where it is written
  if (overwrite || !fs::exists(output, failure)) return;
  throw UsageError(output.string() + ": exists already; pass --overwrite to replace it, or another folder with -o");
}

}  // namespace cnerf::app
