#pragma once
/// What a command of the program is. Each has a file of its own that declares its options and does its work.

#include <CLI/CLI.hpp>
#include <array>
#include <functional>
#include <string>
#include <vector>

namespace cnerf::app {

/// The work of a command, given the words of the command line for its records.
using Work = std::function<void(const std::vector<std::string>& command_line)>;

/// Declares the options of a command on `app` and returns its work, to be called once the line is parsed.
using DeclareCommand = Work (*)(CLI::App& app);

struct Command {
  const char* name;
  const char* summary;
  DeclareCommand declare;
  bool resumable;  ///< after Ctrl-C, the same line with --resume goes on
  bool shared;     ///< processes of one launch work on it together; others do the same thing each
  std::array<const char*, 2> examples;
};

/// A command that `app` stands for.
struct ParsedCommand {
  const Command* command;
  CLI::App* app;
  Work work;
};

/// Declares every command on `program`.
[[nodiscard]] std::vector<ParsedCommand> declare_commands(CLI::App& program);
/// The command that was named when `program` parsed its line.
/// @throws UsageError  none, or one with words that it does not know; with what may be meant
[[nodiscard]] const ParsedCommand& chosen_command(const CLI::App& program, const std::vector<ParsedCommand>& commands);

Work declare_run(CLI::App& app);
Work declare_prepare(CLI::App& app);
Work declare_sample(CLI::App& app);
Work declare_train(CLI::App& app);
Work declare_colorize(CLI::App& app);
Work declare_colorize_image(CLI::App& app);
Work declare_render(CLI::App& app);
Work declare_eval(CLI::App& app);
Work declare_compare(CLI::App& app);
Work declare_report(CLI::App& app);
Work declare_bake(CLI::App& app);
Work declare_view(CLI::App& app);
Work declare_studio(CLI::App& app);
Work declare_info(CLI::App& app);
Work declare_doctor(CLI::App& app);

}  // namespace cnerf::app
