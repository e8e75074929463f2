#include "src/config/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <set>
#include <sstream>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/config/toml_binding.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

void read_config_file(const std::filesystem::path& file, Config& config) {
  read_toml(read_text_file(file), file.string(), fields_of(config), retired_keys());
}
void apply_setting(std::string_view setting, Config& config) {
  cnerf::apply_setting(setting, fields_of(config), retired_keys());
}
namespace fs = std::filesystem;
using testing::HasSubstr;

std::vector<fs::path> preset_files() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(fs::path(CNERF_SOURCE_DIR) / "configs"))
    files.push_back(entry.path());
  return files;
}

TEST(Config, EveryPresetIsReadCheckedAndWrittenBack) {
  ASSERT_GE(preset_files().size(), 3u);
  for (const fs::path& file : preset_files()) {
    SCOPED_TRACE(file);
    Config config;
    read_config_file(file, config);
    check_consistency(config);
    const std::string text = to_toml(config);
    Config again;
    read_toml(text, "again.toml", fields_of(again));
    EXPECT_EQ(to_toml(again), text);
  }
}

/// A preset that repeats a default hides which of the two is meant when the default moves.
TEST(Config, PresetsHoldDifferencesOnlyEachWithItsReason) {
  Config defaults;
  const std::string default_text = to_toml(defaults);
  for (const fs::path& file : preset_files()) {
    SCOPED_TRACE(file);
    const std::string text = read_text_file(file);
    long assignments = 0;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      const auto equals = line.find(" = ");
      if (line.starts_with('#') || equals == std::string::npos) continue;
      ++assignments;
      EXPECT_THAT(line, HasSubstr("  # ")) << "a value without its reason";
    }
    Config config;
    read_config_file(file, config);
    const auto changed = fields_of(config);
    const auto original = fields_of(defaults);
    long differences = 0;
    for (std::size_t i = 0; i < changed.size(); ++i) {
      differences += write_toml({changed[i]}) != write_toml({original[i]});
    }
    EXPECT_EQ(differences, assignments) << "a value that equals the default";
  }
  EXPECT_EQ(to_toml(Config{}), default_text);
}

/// Defaults are legal themselves, and no two options share a name.
TEST(Config, DefaultsAreInTheirRanges) {
  Config config;
  Config read;
  read_toml(to_toml(config), "defaults.toml", fields_of(read));
  std::set<std::string> keys;
  for (const Field& field : fields_of(config)) EXPECT_TRUE(keys.insert(field.key).second) << field.key;
  EXPECT_GT(keys.size(), 40u);
}

std::string option_table(const std::vector<Field>& fields) {
  std::string text = "| option | default | legal | what |\n|---|---|---|---|\n";
  for (const Field& field : fields) {
    const std::string line = write_toml({field});
    const auto begin = line.find(" = ") + 3;
    const std::string value = line.substr(begin, line.find("  # ") - begin);
    std::ostringstream legal;
    if (field.range) legal << (field.range->or_zero ? "0, " : "") << field.range->min << " to " << field.range->max;
    for (const std::string& choice : field.choices) legal << (choice == field.choices.front() ? "" : ", ") << choice;
    text += "| `" + field.key + "` | `" + value + "` | " + legal.str() + " | " + field.help + " |\n";
  }
  return text;
}

/// docs/configuration.md holds a table of every option. Set CNERF_UPDATE_DOCS=1 to write it anew.
std::string option_tables() {
  Config config;
  return option_table(fields_of(config));
}

TEST(Config, TheDocumentedTableIsTheRealOne) {
  const fs::path file = fs::path(CNERF_SOURCE_DIR) / "docs" / "configuration.md";
  const std::string text = read_text_file(file);
  const auto begin = text.find("| option |");
  ASSERT_NE(begin, std::string::npos);
  if (std::getenv("CNERF_UPDATE_DOCS") != nullptr) write_file(file, text.substr(0, begin) + option_tables());
  EXPECT_EQ(read_text_file(file).substr(begin), option_tables()) << "run this test with CNERF_UPDATE_DOCS=1";
}

TEST(Config, ErrorsOfAFileNameTheFile) {
  const test::TempDir folder;
  write_file(folder / "mine.toml", std::string_view("[stage1]\nsteps = -4\n"));
  Config config;
  try {
    read_config_file(folder / "mine.toml", config);
    FAIL() << "a negative number of steps was accepted";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("mine.toml"), HasSubstr("stage1.steps"), HasSubstr("got -4")));
  }
  EXPECT_THROW(read_config_file(folder / "absent.toml", config), MissingInputError);
}

TEST(Config, RetiredKeysAreGoneAndTheirSuccessorsAreThere) {
  Config config;
  const auto fields = fields_of(config);
  const auto is_option = [&](const std::string& key) { return std::ranges::count(fields, key, &Field::key) > 0; };
  for (const RetiredKey& old : retired_keys()) {
    EXPECT_FALSE(is_option(old.key)) << old.key;
    EXPECT_EQ(is_option(old.now), !old.now.empty()) << old.now;
    EXPECT_NE(old.instead.empty(), old.now.empty()) << old.key << " says not what to do instead";
  }
}

/// Every run of an earlier version holds them.
TEST(Config, DefaultsOfRetiredKeysSayNothing) {
  const test::TempDir folder;
  for (const RetiredKey& old : retired_keys()) {
    if (old.was.empty()) continue;
    const auto dot = old.key.rfind('.');
    write_file(folder / "old_run.toml",
               "[" + old.key.substr(0, dot) + "]\n" + old.key.substr(dot + 1) + " = " + old.was);
    Config config;
    EXPECT_THAT(read_run_config(folder / "old_run.toml", config), testing::IsEmpty());
  }
}

TEST(Config, TheDilationHasOneKey) {
  const test::TempDir folder;
  write_file(folder / "mine.toml", std::string_view("[vdb]\ndilation = 3\n"));
  Config config;
  const auto message_of = [](const auto& action) -> std::string {
    try {
      action();
    } catch (const UsageError& error) {
      return error.what();
    }
    return "(nothing was thrown)";
  };
  EXPECT_THAT(message_of([&] { read_config_file(folder / "mine.toml", config); }),
              testing::AllOf(HasSubstr("mine.toml: vdb.dilation: "), HasSubstr("'bake.dilation'"), HasSubstr("got 3")));
  EXPECT_THAT(message_of([&] { apply_setting("vdb.dilation=3", config); }), HasSubstr("'bake.dilation'"));
  EXPECT_NO_THROW(apply_setting("bake.dilation=3", config));

  // A run from before it was retired: nobody wrote that key by hand.
  write_file(folder / "old_run.toml", std::string_view("[bake]\ndilation = 4\n[vdb]\ndilation = 4\n"));
  EXPECT_NO_THROW(read_run_config(folder / "old_run.toml", config));
  EXPECT_EQ(config.bake.dilation, 4);
}

/// Options of the comparison stood in each run's file until they got a section of their own.
TEST(Config, OptionsOfTheComparisonAreRefusedByNameAndReadInOldRuns) {
  const test::TempDir folder;
  write_file(folder / "run.toml",
             std::string_view("[compare]\nstyle_steps = 160\npositional_geometry = 'shared'\n"
                              "positional_budget = 4.0\npositional_learning_rate = 5e-04\n"
                              "positional_final_learning_rate = 5e-05\npositional_trains_encoding = false\n"
                              "style_network = ''\nstyle_reference = ''\n"));
  Config config;
  EXPECT_THAT(read_run_config(folder / "run.toml", config), testing::IsEmpty());
  try {
    apply_setting("compare.style_steps=20", config);
    FAIL() << "a run takes an option of the comparison";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("cnerf compare"));
  }
}

TEST(Config, RelationsBetweenOptionsAreChecked) {
  Config config;
  EXPECT_NO_THROW(check_consistency(config));
  config.stage1.grid.finest_resolution = config.stage1.grid.coarsest_resolution - 1;
  EXPECT_THROW(check_consistency(config), UsageError);
  const test::TempDir folder;
  write_file(folder / "run.toml", "stage2.grid.coarsest_resolution = 640\n");
  (void)read_run_config(folder / "run.toml", config = {});
  EXPECT_NO_THROW(check_consistency(config));
  apply_setting("stage2.grid.finest_resolution=32", config);
  try {
    check_consistency(config);
    FAIL() << "a coarsest level finer than the finest";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr((folder / "run.toml").string()), HasSubstr("640")));
  }
}

TEST(Config, PresetsAreFoundByName) {
  EXPECT_THAT(preset_names(), testing::IsSupersetOf({"default", "quality", "quick"}));
  EXPECT_TRUE(fs::exists(preset_file("quick")));
  try {
    (void)preset_file("qick");
    FAIL() << "an unknown preset was found";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(),
                testing::AllOf(HasSubstr("did you mean 'quick'"), HasSubstr("default, gpu, quality, quick")));
  }
}

}  // namespace
}  // namespace cnerf
