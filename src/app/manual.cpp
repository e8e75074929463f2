#include "src/app/manual.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "src/app/exit_codes.h"
#include "src/base/process.h"
#include "src/base/text.h"
#include "src/config/config.h"

namespace cnerf::app {
namespace {

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
  return text;
}

/// Text as roff prints it: hyphens that can be copied, and no line that roff takes for a request.
std::string roff(const std::string& text) {
  const std::string escaped = replaced(replaced(text, "\\", "\\e"), "-", "\\-");
  return escaped.starts_with('.') || escaped.starts_with('\'') ? "\\&" + escaped : escaped;
}

std::string bold(const std::string& text) {
  return "\\fB" + roff(text) + "\\fR";
}
std::string italic(const std::string& text) {
  return "\\fI" + roff(text) + "\\fR";
}

/// "-o" and "--out"; nothing of what has its place instead of a name.
std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

bool takes_value(const CLI::Option& option) {
  return option.get_expected_max() > 0;
}

/// A description of one line, without what would look like a break.
std::string help_of(const CLI::Option& option) {
  return replaced(option.get_description(), "\n", " ");
}

std::vector<const CLI::Option*> options_of(const CLI::App& app, bool positional) {
  return app.get_options(
      [&](const CLI::Option* option) { return positional ? option->get_positional() : option->nonpositional(); });
}

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : options_of(app, false)) {
    for (const std::string& name : names_of(*option)) names.push_back(name);
  }
  return names;
}

std::vector<std::string> command_names(const std::vector<ParsedCommand>& commands) {
  std::vector<std::string> names;
  for (const ParsedCommand& each : commands) names.emplace_back(each.command->name);
  return names;
}

std::vector<std::string> config_keys() {
  Config config;
  std::vector<std::string> keys;
  for (const Field& field : fields_of(config)) keys.push_back(field.key);
  return keys;
}

std::string heading(std::string name, const ManualEdition& edition) {
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return char(std::toupper(c)); });
  return fmt::format(".TH {} 1 {} \"cnerf {}\" \"cnerf manual\"\n", name, edition.date, edition.version);
}

std::string entry(const std::string& term, const std::string& text) {
  return ".TP\n" + term + "\n" + roff(text) + "\n";
}

std::string option_entry(const CLI::Option& option) {
  std::string term;
  for (const std::string& name : names_of(option)) term += (term.empty() ? "" : ", ") + bold(name);
  return entry(term + (takes_value(option) ? " " + italic("VALUE") : ""), help_of(option));
}

/// One argument of zsh's _arguments: '--out[Folder of the run]:value:_files'.
std::string zsh_argument(const CLI::Option& option, const std::string& name) {
  std::string help = help_of(option);
  for (const char* special : {"\\", "[", "]", ":"}) help = replaced(help, special, std::string("\\") + special);
  std::string value = takes_value(option) ? ":value:_files" : "";
  if (name == "--preset") value = ":preset:(" + joined(preset_names(), " ") + ")";
  if (name == "--set") value = ":key:(" + joined(config_keys(), "= ") + "=)";
  return shell_word("*" + name + "[" + help + "]" + value);
}

/// One line of fish's completion of a command's options.
std::string fish_line(const std::string& command, const CLI::Option& option) {
  std::string line = "complete -c cnerf -n " + shell_word("__fish_seen_subcommand_from " + command);
  for (const std::string& name : option.get_snames()) line += " -s " + name;
  for (const std::string& name : option.get_lnames()) {
    line += " -l " + name;
    if (name == "preset") line += " -a " + shell_word(joined(preset_names(), " "));
    if (name == "set") line += " -a " + shell_word(joined(config_keys(), "= ") + "=");
  }
  return line + (takes_value(option) ? " -r" : "") + " -d " + shell_word(replaced(help_of(option), "\\", "\\\\")) +
         "\n";
}

}  // namespace

std::string program_page(const std::vector<ParsedCommand>& commands, const ManualEdition& edition) {
  std::string page = heading("cnerf", edition);
  page += ".SH NAME\ncnerf \\- colour volumes from monochrome photographs or film clips\n";
  page += ".SH SYNOPSIS\n" + bold("cnerf") + " " + italic("COMMAND") + " [" + italic("OPTIONS") + "]\n";
  page += ".SH COMMANDS\n";
  for (const ParsedCommand& each : commands) page += entry(bold(each.command->name), each.command->summary);
  page += ".SH CONFIGURATION\nKeys of " + bold("--set") + " and of files that " + bold("--config") + " reads.\n";
  Config config;
  for (const Field& field : fields_of(config)) page += entry(bold(field.key), field.help);
  page += ".SH EXIT STATUS\n";
  for (const auto& [code, meaning] : kExitCodes) page += entry(bold(std::to_string(int(code))), meaning);
  page += ".SH ENVIRONMENT\n";
  page +=
      entry(bold("NO_COLOR"), "Where it is set and not empty, errors are not coloured; off a terminal they never are.");
  page += ".SH SEE ALSO\n";
  for (const std::string& name : command_names(commands)) {
    page += ".BR " + roff("cnerf-" + name) + " (1)" + (name == commands.back().command->name ? "\n" : ",\n");
  }
  return page;
}

std::string command_page(const ParsedCommand& command, const ManualEdition& edition) {
  const std::string name = command.command->name;
  std::string page = heading("cnerf-" + name, edition);
  page += ".SH NAME\n" + roff("cnerf-" + name + " - " + command.command->summary) + "\n";
  page += ".SH SYNOPSIS\n" + bold("cnerf " + name);
  for (const CLI::Option* argument : options_of(*command.app, true)) {
    const std::string word = italic(argument->get_name(true));
    page += argument->get_required() ? " " + word : " [" + word + "]";
  }
  page += " [" + italic("OPTIONS") + "]\n";
  if (const auto arguments = options_of(*command.app, true); !arguments.empty()) {
    page += ".SH ARGUMENTS\n";
    for (const CLI::Option* argument : arguments) page += entry(italic(argument->get_name(true)), help_of(*argument));
  }
  page += ".SH OPTIONS\n";
  for (const CLI::Option* option : options_of(*command.app, false)) page += option_entry(*option);
  page += ".SH EXAMPLES\n.nf\n";
  for (const char* example : command.command->examples) page += roff(example) + "\n";
  page += ".fi\n.SH EXIT STATUS\nThe list is in\n.BR cnerf (1).\n.SH SEE ALSO\n.BR cnerf (1)\n";
  return page;
}

std::string bash_completion(const std::vector<ParsedCommand>& commands) {
  std::string script = R"(# Completion of cnerf for bash, generated from the program's declarations.
_cnerf() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} words=
  if [ "$COMP_CWORD" -eq 1 ]; then
    words=')" + joined(command_names(commands), " ") +
                       R"( --help --version'
  elif [ "$before" = --preset ]; then
    words=')" + joined(preset_names(), " ") +
                       R"('
  elif [ "$before" = --set ]; then
    words=')" + joined(config_keys(), "= ") +
                       R"(='
    compopt -o nospace 2> /dev/null
  elif [[ $word == -* ]]; then
    case ${COMP_WORDS[1]} in
)";
  for (const ParsedCommand& each : commands) {
    script += fmt::format("      {}) words='{}' ;;\n", each.command->name, joined(option_names(*each.app), " "));
  }
  return script + R"(    esac
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
}
complete -o default -F _cnerf cnerf
)";
}

std::string zsh_completion(const std::vector<ParsedCommand>& commands) {
  std::string script = "#compdef cnerf\n# Completion of cnerf for zsh, generated from the program's declarations.\n";
  script += "local -a commands=(\n";
  for (const ParsedCommand& each : commands) {
    script +=
        "  " + shell_word(std::string(each.command->name) + ":" + replaced(each.command->summary, ":", "\\:")) + "\n";
  }
  script += ")\nif (( CURRENT == 2 )); then\n  _describe command commands\n  return\nfi\n";
  script += "local command=$words[2]\nshift words\n(( CURRENT-- ))\ncase $command in\n";
  for (const ParsedCommand& each : commands) {
    script += fmt::format("  {})\n    _arguments", each.command->name);
    for (const CLI::Option* option : options_of(*each.app, false)) {
      for (const std::string& name : names_of(*option)) script += " \\\n      " + zsh_argument(*option, name);
    }
    script += " \\\n      '*:file:_files'\n    ;;\n";
  }
  return script + "esac\n";
}

std::string fish_completion(const std::vector<ParsedCommand>& commands) {
  std::string script = "# Completion of cnerf for fish, generated from the program's declarations.\n";
  for (const ParsedCommand& each : commands) {
    script += fmt::format("complete -c cnerf -f -n __fish_use_subcommand -a {} -d {}\n", each.command->name,
                          shell_word(each.command->summary));
  }
  for (const ParsedCommand& each : commands) {
    for (const CLI::Option* option : options_of(*each.app, false)) script += fish_line(each.command->name, *option);
  }
  return script;
}

}  // namespace cnerf::app
