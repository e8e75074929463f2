#include "src/app/manual.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <regex>

#include "src/app/exit_codes.h"
#include "src/base/files.h"
#include "src/base/process.h"
#include "tests/support/data.h"

namespace cnerf::app {
namespace {

using cnerf::test::TempDir;
using testing::HasSubstr;
using testing::IsEmpty;

const ManualEdition kEdition = {"1.2.3", "2001-02-03"};

class Manual : public testing::Test {
 protected:
  CLI::App program_;
  std::vector<ParsedCommand> commands_ = declare_commands(program_);
};

/// Completion as `Manual` has it, in shells; a case skips where its shell is not installed.
class Completion : public Manual {};

struct Outcome {
  int status;
  std::string text;
};

/// What a shell command prints, errors included.
Outcome output_of(const std::string& command) {
  std::FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  Outcome outcome{-1, ""};
  std::array<char, 4096> piece{};
  while (std::fgets(piece.data(), int(piece.size()), pipe) != nullptr) outcome.text += piece.data();
  outcome.status = ::pclose(pipe);
  return outcome;
}

/// Option names of a --help text.
std::vector<std::string> options_in(const std::string& help) {
  static const std::regex pattern("(^|[\\s,])(--?[a-z][a-z-]*)(?=[\\s,]|$)");
  std::vector<std::string> found;
  const std::string options = help.substr(0, help.find("\nExamples:"));
  for (std::sregex_iterator it(options.begin(), options.end(), pattern), end; it != end; ++it)
    found.push_back((*it)[2]);
  return found;
}

/// A page as it is read, without what roff needs.
std::string plain(std::string page) {
  for (const char* markup : {"\\fB", "\\fI", "\\fR", "\\&"}) {
    for (std::size_t at; (at = page.find(markup)) != std::string::npos;) page.erase(at, 3);
  }
  return std::regex_replace(page, std::regex(R"(\\-)"), "-");
}

TEST_F(Manual, PagesListEveryOptionOfHelp) {
  for (const ParsedCommand& each : commands_) {
    const std::string page = plain(command_page(each, kEdition));
    const std::vector<std::string> options = options_in(each.app->help());
    EXPECT_THAT(options, testing::Contains("--help"));
    for (const std::string& option : options) EXPECT_THAT(page, HasSubstr(option)) << each.command->name;
    for (const char* example : each.command->examples) EXPECT_THAT(page, HasSubstr(example));
  }
}

TEST_F(Manual, ListsCommandsKeysAndExitCodes) {
  const std::string page = plain(program_page(commands_, kEdition));
  for (const ParsedCommand& each : commands_) EXPECT_THAT(page, HasSubstr(each.command->summary));
  EXPECT_THAT(page, HasSubstr("stage2.grid.finest_resolution"));
  EXPECT_THAT(program_.help(), HasSubstr(exit_codes_text()));
  for (const auto& [code, meaning] : kExitCodes) EXPECT_THAT(page, HasSubstr(meaning));
}

TEST_F(Manual, ListsEveryExitCodeThatThereIs) {
  const std::string header = read_text_file(std::filesystem::path(CNERF_SOURCE_DIR) / "src/base/error.h");
  static const std::regex pattern(R"(\n  k[A-Z]\w+ = (\d+),)");
  std::vector<int> declared, listed;
  for (std::sregex_iterator it(header.begin(), header.end(), pattern), end; it != end; ++it) {
    declared.push_back(std::stoi((*it)[1]));
  }
  for (const auto& [code, meaning] : kExitCodes) listed.push_back(int(code));
  EXPECT_EQ(listed, declared);
}

TEST_F(Manual, PagesAreCleanRoff) {
  if (!find_program("mandoc")) GTEST_SKIP() << "mandoc is not installed";
  const TempDir folder;
  write_file(folder / "cnerf.1", program_page(commands_, kEdition));
  for (const ParsedCommand& each : commands_) {
    write_file(folder / ("cnerf-" + std::string(each.command->name) + ".1"), command_page(each, kEdition));
  }
  const Outcome lint = output_of("mandoc -T lint -W warning " + (folder / "*.1").string());
  EXPECT_THAT(lint.text, IsEmpty());
  write_file(folder / "wrong.1", command_page(commands_.front(), kEdition) + ".XY\n");
  EXPECT_THAT(output_of("mandoc -T lint -W warning " + (folder / "wrong.1").string()).text, HasSubstr("unknown macro"));
}

TEST_F(Manual, ExamplesAreParsed) {
  for (const ParsedCommand& each : commands_) {
    for (const std::string example : each.command->examples) {
      CLI::App program("", "cnerf");
      program.allow_extras();
      const std::vector<ParsedCommand> commands = declare_commands(program);
      ASSERT_NO_THROW(program.parse(example, true)) << example;
      EXPECT_EQ(chosen_command(program, commands).command->name, std::string(each.command->name)) << example;
    }
    const std::string help = each.app->help();
    EXPECT_THAT(help, testing::ContainsRegex("Examples:\n  cnerf [^\n]*\n  cnerf [^\n]*\n\n*$"));
  }
}

TEST_F(Manual, EveryCommandCanBeQuiet) {
  for (const ParsedCommand& each : commands_) EXPECT_THAT(each.app->help(), HasSubstr("--quiet"));
}

/// What bash offers for a line whose last word is being typed.
std::string offered(const std::filesystem::path& script, const std::string& line, int words) {
  return output_of("bash --norc -c 'source " + script.string() + "; COMP_WORDS=(" + line +
                   "); COMP_CWORD=" + std::to_string(words - 1) + "; _cnerf; echo \"${COMPREPLY[@]}\"'")
      .text;
}

TEST_F(Completion, OfBashOffersCommandsOptionsPresetsAndKeys) {
  const TempDir folder;
  const auto script = folder / "cnerf";
  write_file(script, bash_completion(commands_));
  EXPECT_EQ(offered(script, "cnerf stu", 2), "studio\n");
  EXPECT_EQ(offered(script, "cnerf bake --resol", 3), "--resolution\n");
  EXPECT_EQ(offered(script, "cnerf run photos --preset qua", 5), "quality\n");
  EXPECT_EQ(offered(script, "cnerf run --set capture.hold", 4), "capture.holdout=\n");
  EXPECT_EQ(offered(script, "cnerf run pho", 3), "\n") << "files are bash's own";
}

TEST_F(Completion, OfZshAndFishIsTheirLanguage) {
  const TempDir folder;
  write_file(folder / "_cnerf", zsh_completion(commands_));
  write_file(folder / "cnerf.fish", fish_completion(commands_));
  bool checked = false;
  for (const auto& [shell, file] : {std::pair("zsh", "_cnerf"), std::pair("fish", "cnerf.fish")}) {
    if (!find_program(shell)) continue;
    checked = true;
    const Outcome outcome = output_of(std::string(shell) + " -n " + (folder / file).string());
    EXPECT_EQ(outcome.status, 0) << outcome.text;
  }
  if (find_program("fish")) {
    const Outcome offers = output_of("fish --no-config -c 'source " + (folder / "cnerf.fish").string() +
                                     "; complete -C \"cnerf bake --resol\"'");
    EXPECT_THAT(offers.text, HasSubstr("--resolution\t"));
  }
  if (!checked) GTEST_SKIP() << "neither zsh nor fish is installed";
}

}  // namespace
}  // namespace cnerf::app
