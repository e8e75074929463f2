#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "tests/support/data.h"

namespace cnerf::app {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

/// What the words of a line choose.
std::string chosen(const std::string& line) {
  CLI::App program;
  program.allow_extras();
  const std::vector<ParsedCommand> commands = declare_commands(program);
  program.parse(line);
  return chosen_command(program, commands).command->name;
}

/// A short form of an option that is gone aborts where it is declared, and each start declares all commands.
TEST(Commands, AreAllDeclaredWithHelp) {
  CLI::App program;
  const std::vector<ParsedCommand> commands = declare_commands(program);
  EXPECT_GE(commands.size(), 12u);
  for (const ParsedCommand& each : commands) {
    EXPECT_TRUE(each.work) << each.command->name;
    EXPECT_THAT(each.app->help(), HasSubstr(each.command->summary));
  }
}

TEST(Commands, AreChosenByName) {
  EXPECT_EQ(chosen("doctor"), "doctor");
  EXPECT_EQ(chosen("info somewhere"), "info");
  EXPECT_THAT([] { (void)chosen("docter"); }, ThrowsMessage<UsageError>(HasSubstr("did you mean 'doctor'")));
  EXPECT_THAT([] { (void)chosen("info a --downscal 2"); }, ThrowsMessage<UsageError>(HasSubstr("--downscale")));
  EXPECT_THAT([] { (void)chosen(""); }, ThrowsMessage<UsageError>(HasSubstr("a command is needed")));
}

TEST(Output, LiesBesideItsSource) {
  const cnerf::test::TempDir folder;
  std::filesystem::create_directory(folder / "roll.7");
  EXPECT_EQ(output_beside(folder / "roll.7", "run"), folder / "roll.7-run");
  EXPECT_EQ(output_beside(folder.path() / "roll.7" / "", "run"), folder / "roll.7-run");
  EXPECT_EQ(output_beside(folder / "clip.mp4", "capture"), folder / "clip-capture");
}

TEST(Output, IsAnnouncedOnlyWhereItWasChosen) {
  const cnerf::test::TempDir folder;
  const auto printed = [&](const std::string& given) {
    std::FILE* out = std::fopen((folder / "out").c_str(), "w");
    Reporter reporter(ProgressStyle::kPlain, out);
    EXPECT_EQ(chosen_output(given, "photos-run", reporter), given.empty() ? "photos-run" : given);
    std::fclose(out);
    return read_text_file(folder / "out");
  };
  EXPECT_EQ(printed(""), "no -o given: writing to photos-run\n");
  EXPECT_EQ(printed("mine"), "");
}

TEST(Commands, FoldersMayBeNamedLikeCommands) {
  EXPECT_EQ(chosen("studio run"), "studio");
  EXPECT_EQ(chosen("bake run --grids one"), "bake");
  EXPECT_EQ(chosen("info sample --downscale 2"), "info");
}

}  // namespace
}  // namespace cnerf::app
