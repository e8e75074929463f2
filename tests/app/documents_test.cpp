/// Every line of every document that calls the program has to be one that the program takes.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <regex>
#include <sstream>

#include "src/app/command.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/config/config.h"
#include "src/config/fields.h"

namespace cnerf::app {
namespace {
namespace fs = std::filesystem;

/// A call of the program as a document has it.
struct Call {
  std::string where;  ///< file:line
  std::string words;  ///< behind the program's name
  bool is_whole;      ///< a line of a code block; a span in prose may leave out what has to be given
};

std::string replaced(const std::string& text, const char* pattern, const char* by) {
  return std::regex_replace(text, std::regex(pattern), by);
}

/// The words as a shell would hand them over, a stand-in where the reader is to think of something.
std::string plain_words(std::string words) {
  words = replaced(words, R"(\s+#(\s.*)?$)", "");                     // a comment
  words = replaced(words, R"(\s*(;|\||>|&&|2>).*$)", "");             // what the shell does besides
  words = replaced(words, R"([\[\]])", "");                           // what may be left out
  return replaced(words, "(^| )(\\.\\.\\.|\xE2\x80\xA6)", "$1some");  // "..." and its one-letter form
}

/// `cnerf`, `build/release/cnerf` and the like, perhaps behind variables of the environment.
std::optional<std::string> words_of_call(const std::string& line) {
  static const std::regex call(R"re(^\s*(?:\$ )?(?:[A-Z_]+=\S+ )*(?:[\w./]*/)?cnerf(?: (.*))?$)re");
  std::smatch match;
  if (!std::regex_match(line, match, call)) return std::nullopt;
  return plain_words(match[1]);
}

std::vector<Call> calls_in_prose(const std::string& line, const std::string& where) {
  static const std::regex span("`([^`]+)`");
  std::vector<Call> calls;
  for (std::sregex_iterator at(line.begin(), line.end(), span), end; at != end; ++at) {
    const auto words = words_of_call((*at)[1]);
    if (words && !words->empty()) calls.push_back({where, *words, false});
  }
  return calls;
}

/// Calls in the code blocks and code spans of a document in Markdown.
std::vector<Call> calls_in(const std::string& name, const std::string& markdown) {
  std::vector<Call> calls;
  std::istringstream lines(markdown);
  bool is_code = false;
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    const std::string where = name + ":" + std::to_string(++number);
    if (line.starts_with("```")) {
      is_code = !is_code;
    } else if (is_code) {
      for (std::string more; line.ends_with('\\') && std::getline(lines, more); ++number) {
        line = line.substr(0, line.size() - 1) + more;
      }
      if (const auto words = words_of_call(line)) calls.push_back({where, *words, true});
    } else {
      std::ranges::copy(calls_in_prose(line, where), std::back_inserter(calls));
    }
  }
  return calls;
}

/// Documents that speak of the program as it is: those of `docs/history` speak of what it was.
std::vector<fs::path> documents() {
  const fs::path root = CNERF_SOURCE_DIR;
  std::vector<fs::path> files;
  const auto take = [&](const fs::path& file) {
    if (file.extension() == ".md") files.push_back(file);
  };
  for (const auto& entry : fs::directory_iterator(root)) take(entry.path());
  for (const auto& entry : fs::recursive_directory_iterator(root / "docs")) {
    if (entry.path().string().find("/history/") == std::string::npos) take(entry.path());
  }
  return files;
}

/// Refuses `--set` of a key and `--preset` of a name that there are not.
void check_settings(const CLI::App& command) {
  Config config;
  const std::vector<Field> fields = fields_of(config);
  const auto results = [&](const char* option) {
    const CLI::Option* found = command.get_option_no_throw(option);
    return found == nullptr ? std::vector<std::string>{} : found->results();
  };
  for (const std::string& setting : results("--set")) {
    const std::string key = setting.substr(0, setting.find('='));
    const bool is_named = std::ranges::any_of(fields, [&](const Field& field) { return field.key == key; });
    if (!is_named) throw UsageError("--set: there is no option '" + key + "'");
  }
  for (const std::string& preset : results("--preset")) (void)preset_file(preset);
}

/// Parses the words of a call as the program does; nothing is run.
/// @param is_lenient  what has to be given may be missing
/// @throws CLI::ParseError, Error
void parse(const std::string& words, bool is_lenient) {
  CLI::App program;
  program.allow_extras();
  program.set_version_flag("--version", "");
  const std::vector<ParsedCommand> commands = declare_commands(program);
  for (const ParsedCommand& each : commands) {
    for (CLI::Option* option : each.app->get_options()) {
      if (is_lenient) option->required(false);
    }
  }
  program.parse(words);
  check_settings(*chosen_command(program, commands).app);
}

/// What the program has against a call; empty where it takes it.
std::string objection(const Call& call, bool is_lenient = false) {
  const auto says = [&](const std::exception& error) {
    return call.where + ": cnerf " + call.words + ": " + error.what() + "\n";
  };
  try {
    parse(call.words, is_lenient);
  } catch (const CLI::RequiredError& error) {
    return call.is_whole || is_lenient ? says(error) : objection(call, true);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != 0) return says(error);  // --help and --version are none
  } catch (const Error& error) {
    return says(error);
  }
  return "";
}

std::string objections(const std::vector<Call>& calls) {
  std::string all;
  for (const Call& call : calls) all += objection(call);
  return all;
}

TEST(Documents, CallTheProgramAsItIs) {
  std::vector<Call> calls;
  for (const fs::path& file : documents()) {
    const std::string name = fs::relative(file, CNERF_SOURCE_DIR).generic_string();
    std::ranges::copy(calls_in(name, read_text_file(file)), std::back_inserter(calls));
  }
  EXPECT_GT(calls.size(), 60u) << "the documents were not found";
  EXPECT_EQ(objections(calls), "");
}

/// Code spans that look like options and are none; files of a run look like them too.
std::vector<std::string> unknown_options(const std::string& markdown) {
  static const std::regex span(
      R"re(`((?:capture|stage1|stage2|colorizer|bake|vdb|mesh|web|render|finish)\.[a-z0-9_.]+)[`= ])re");
  Config config;
  const std::vector<Field> fields = fields_of(config);
  std::vector<std::string> unknown;
  for (std::sregex_iterator at(markdown.begin(), markdown.end(), span), end; at != end; ++at) {
    const std::string key = (*at)[1];
    const bool is_file = key == "stage1.snapshot" || key == "mesh.gltf" || key == "mesh.glb" || key == "mesh.bin";
    const bool is_option = std::ranges::any_of(
        fields, [&](const Field& field) { return field.key == key || field.key.starts_with(key + "."); });
    if (!is_file && !is_option) unknown.push_back(key);
  }
  return unknown;
}

TEST(Documents, NameOptionsThatThereAre) {
  for (const fs::path& file : documents()) {
    EXPECT_THAT(unknown_options(read_text_file(file)), testing::IsEmpty()) << file;
  }
  EXPECT_THAT(unknown_options("`stage1.steps`, `stage2.purify`, `bake.grid=one`"), testing::ElementsAre("bake.grid"));
}

TEST(Documents, CallsAreFoundInBlocksAndSpans) {
  const std::vector<Call> calls = calls_in("a.md",
                                           "Prose about cnerf and `cnerf doctor`, `cnerf-vdb-reader x`.\n"
                                           "```bash\n"
                                           "build/release/cnerf info photos   # a comment\n"
                                           "A=1 cnerf train photos \\\n"
                                           "  -o out | tee log\n"
                                           "bash scripts/demo.sh\n"
                                           "```\n");
  std::vector<std::string> found;
  for (const Call& call : calls) found.push_back(call.where + " " + call.words);
  EXPECT_THAT(found, testing::ElementsAre("a.md:1 doctor", "a.md:3 info photos", "a.md:4 train photos   -o out"));
}

/// The checks can fail.
TEST(Documents, MistakesAreFound) {
  const auto of_line = [](const std::string& line) { return objections(calls_in("a.md", "```\n" + line + "\n```\n")); };
  EXPECT_EQ(of_line("cnerf train photos -o out --preset quick --set stage1.steps=9"), "");
  EXPECT_EQ(of_line("cnerf bake --help"), "");
  EXPECT_THAT(of_line("cnerf trian photos -o out"), testing::HasSubstr("a.md:2: cnerf trian"));
  EXPECT_THAT(of_line("cnerf train photos -o out --downscal 2"), testing::HasSubstr("--downscale"));
  EXPECT_THAT(of_line("cnerf train -o out"), testing::HasSubstr("CAPTURE"));
  EXPECT_THAT(of_line("cnerf train photos -o out --set stage1.step=9"), testing::HasSubstr("stage1.step"));
  EXPECT_THAT(of_line("cnerf train photos -o out --preset fast"), testing::HasSubstr("fast"));
  EXPECT_EQ(objections(calls_in("a.md", "In prose `cnerf train --downscale 2` is enough.")), "");
}

}  // namespace
}  // namespace cnerf::app
