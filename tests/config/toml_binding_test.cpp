#include "src/config/toml_binding.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "src/base/error.h"

namespace cnerf {
namespace {

using testing::AllOf;
using testing::HasSubstr;

struct InnerOptions {
  double rate = 0.1;
  template <typename Visitor>
  void visit(Visitor&& v) {
    v("rate", rate, Range{1e-8, 1}, "a rate");
  }
};

struct TestOptions {
  int steps = 10;
  int every = 0;
  float weight = 0.25f;
  bool enabled = true;
  std::string mode = "fast";
  std::string note;
  std::vector<std::string> files;
  InnerOptions inner;
  template <typename Visitor>
  void visit(Visitor&& v) {
    v.section("inner", inner);  // before plain keys: writing has to reorder
    v("steps", steps, Range{1, 1e8}, "steps");
    v("every", every, Range{2, 9, true}, "every");
    v("weight", weight, Range{-1, 1}, "weight");
    v("enabled", enabled, "enabled");
    v("mode", mode, Choice{"fast", "slow"}, "mode");
    v("note", note, "note");
    v("files", files, "files");
  }
};

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const UsageError& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kUsage);
    return error.what();
  }
  return "(nothing was thrown)";
}

std::string reading(const std::string& toml) {
  TestOptions options;
  return message_of([&] { read_toml(toml, "my.toml", fields_of(options)); });
}

std::string setting(const std::string& text) {
  TestOptions options;
  return message_of([&] { apply_setting(text, fields_of(options)); });
}

TEST(TomlBinding, ReadsEveryTypeAndLeavesAbsentKeysAlone) {
  TestOptions options;
  read_toml("weight = -0.5\nenabled = false\nmode = 'slow'\nfiles = ['a', 'b c']\n[inner]\nrate = 1\n", "my.toml",
            fields_of(options));
  EXPECT_EQ(options.steps, 10);
  EXPECT_EQ(options.weight, -0.5f);
  EXPECT_FALSE(options.enabled);
  EXPECT_EQ(options.mode, "slow");
  EXPECT_THAT(options.files, testing::ElementsAre("a", "b c"));
  EXPECT_EQ(options.inner.rate, 1.0) << "an integer is a legal number";
}

TEST(TomlBinding, UnknownKeysNameTheNearestOne) {
  EXPECT_THAT(reading("stesp = 3"), AllOf(HasSubstr("my.toml"), HasSubstr("stesp"), HasSubstr("did you mean 'steps'")));
  EXPECT_THAT(reading("[inner]\nrat = 0.5"), HasSubstr("did you mean 'inner.rate'"));
  EXPECT_THAT(reading("[iner]\nrate = 0.5"), HasSubstr("did you mean 'inner'"));
  EXPECT_THAT(setting("rate=0.5"), HasSubstr("did you mean 'inner.rate'")) << "a left-out section is found";
  EXPECT_THAT(reading("qqqqqqqqqqqq = 1"), AllOf(HasSubstr("unknown key"), testing::Not(HasSubstr("did you mean"))));
}

TEST(TomlBinding, WrongTypesNameFileKeyAndValue) {
  EXPECT_THAT(reading("steps = 'many'"), AllOf(HasSubstr("my.toml: steps"), HasSubstr("integer"), HasSubstr("many")));
  EXPECT_THAT(reading("steps = 1.5"), HasSubstr("expected an integer in [1, 1e+08], got 1.5"));
  EXPECT_THAT(reading("enabled = 1"), HasSubstr("expected true or false, got 1"));
  EXPECT_THAT(reading("note = 3"), HasSubstr("expected a string, got 3"));
  EXPECT_THAT(reading("files = 'a'"), HasSubstr("expected a list of strings"));
  EXPECT_THAT(reading("files = [1]"), HasSubstr("expected a list of strings"));
  EXPECT_THAT(reading("weight = true"), HasSubstr("expected a number"));
  EXPECT_THAT(reading("inner = 3"), HasSubstr("is a section"));
  EXPECT_THAT(reading("steps = \n"), HasSubstr("my.toml: line 1"));
}

TEST(TomlBinding, RangesAreClosedAndNamed) {
  EXPECT_THAT(reading("steps = 0"), HasSubstr("in [1, 1e+08], got 0"));
  EXPECT_THAT(reading("weight = 1.5"), HasSubstr("in [-1, 1], got 1.5"));
  EXPECT_THAT(reading("weight = 9223372036854775807"), HasSubstr("in [-1, 1], got")) << "no double is as large";
  EXPECT_THAT(reading("every = 1"), HasSubstr("in [2, 9] or 0, got 1"));
  EXPECT_THAT(reading("every = 0"), HasSubstr("nothing was thrown"));
  EXPECT_THAT(reading("weight = nan"), HasSubstr("finite"));
  EXPECT_THAT(reading("weight = inf"), HasSubstr("finite"));
  EXPECT_THAT(reading("mode = 'medium'"), HasSubstr("one of fast, slow, got"));
  EXPECT_THAT(reading("steps = 1\nweight = 1.0"), HasSubstr("nothing was thrown"));
}

TEST(TomlBinding, SettingsOfTheCommandLine) {
  TestOptions options;
  const auto fields = fields_of(options);
  apply_setting("steps=12", fields);
  apply_setting("inner.rate=1e-3", fields);
  apply_setting("mode=slow", fields);
  apply_setting("note=exec:python3 a.py --x=\"1\"", fields);
  apply_setting("files=a.png,b.png", fields);
  EXPECT_EQ(options.steps, 12);
  EXPECT_EQ(options.inner.rate, 1e-3);
  EXPECT_EQ(options.mode, "slow");
  EXPECT_EQ(options.note, "exec:python3 a.py --x=\"1\"");
  EXPECT_THAT(options.files, testing::ElementsAre("a.png", "b.png"));
  apply_setting("note=\"quoted\"", fields);
  EXPECT_EQ(options.note, "quoted");

  EXPECT_THAT(setting("steps"), HasSubstr("expected key.path=value"));
  EXPECT_THAT(setting("steps=abc"), HasSubstr("cannot read the value 'abc'"));
  EXPECT_THAT(setting("steps=1\nmode='slow'"), testing::Not(HasSubstr("nothing was thrown")));
  EXPECT_THAT(setting("steps=0"), HasSubstr("--set: steps"));
  EXPECT_THAT(setting("inner=3"), HasSubstr("is a section"));
}

TEST(TomlBinding, TextsMayBeginAsTomlDoes) {
  TestOptions options;
  const auto fields = fields_of(options);
  for (const char* text : {"'60s kitchen", "\"Rosebud", "'a' or 'b'", "[001].jpg=p.png", "[warm] light"}) {
    apply_setting(std::string("note=") + text, fields);
    EXPECT_EQ(options.note, text);
  }
  EXPECT_THAT(setting("mode='slow"), HasSubstr("one of fast, slow, got"));
  EXPECT_THAT(setting("files=[a.png"), HasSubstr("cannot read the value '[a.png'"));
}

TEST(TomlBinding, RoundTripIsExact) {
  TestOptions written;
  written.steps = 100000000;
  written.weight = 0.1f;
  written.inner.rate = 1.0 / 3.0;
  written.note = "a \"quoted\" text\nwith a line, a \\ and é";
  written.files = {"", "x # y"};
  written.enabled = false;
  const std::string text = write_toml(fields_of(written));
  TestOptions read;
  read_toml(text, "written.toml", fields_of(read));
  EXPECT_EQ(read.steps, written.steps);
  EXPECT_EQ(read.weight, written.weight);
  EXPECT_EQ(read.inner.rate, written.inner.rate);
  EXPECT_EQ(read.note, written.note);
  EXPECT_EQ(read.files, written.files);
  EXPECT_EQ(read.enabled, written.enabled);
  EXPECT_EQ(write_toml(fields_of(read)), text);
}

const std::vector<RetiredKey> kRetired{{"pace", "inner.rate", "", ""},
                                       {"inner.speed", "inner.rate", "", ""},
                                       {"old.part.decay", "", "0.5", "it is 0.5 always"},
                                       {"old.kind", "", "'ab'", "there is one kind"}};

TEST(TomlBinding, RetiredKeysNameTheirSuccessor) {
  TestOptions options;
  const auto fields = fields_of(options);
  for (const char* text : {"pace = 0.1", "steps = 3\n[inner]\nspeed = 0.1"}) {
    const std::string message = message_of([&] { read_toml(text, "my.toml", fields, kRetired); });
    EXPECT_THAT(message, AllOf(HasSubstr("my.toml: "), HasSubstr("no option any more, use 'inner.rate'; got 0.1")));
  }
  EXPECT_THAT(message_of([&] { apply_setting("inner.speed=0.7", fields, kRetired); }),
              HasSubstr("--set: inner.speed: is no option any more, use 'inner.rate'; got 0.7"));
  EXPECT_NO_THROW(read_toml("[inner]\nrate = 0.2", "my.toml", fields, kRetired));
}

TEST(TomlBinding, WhatTheProgramWroteMaySayTheSameTwice) {
  TestOptions options;
  const auto fields = fields_of(options);
  const auto reading_back = [&](const char* text) {
    return message_of([&] { read_toml(text, "run.toml", fields, kRetired, Retired::kLeftOut); });
  };
  EXPECT_THAT(reading_back("pace = 0.5\n[inner]\nrate = 0.5\nspeed = 0.5"), HasSubstr("nothing was thrown"));
  EXPECT_EQ(options.inner.rate, 0.5);
  EXPECT_THAT(reading_back("[inner]\nrate = 0.5\nspeed = 0.75"), HasSubstr("run.toml: inner.speed: is no option"));
}

TEST(TomlBinding, RetiredKeysWithoutASuccessorSayWhatToDo) {
  TestOptions options;
  const auto fields = fields_of(options);
  const std::string toml = "[old]\nkind = 'rgb'\n[old.part]\ndecay = 0.5\n";
  EXPECT_THAT(message_of([&] { read_toml(toml, "my.toml", fields, kRetired); }),
              HasSubstr("my.toml: old.part.decay: is no option any more, it is 0.5 always; got 0.5"));
  EXPECT_THAT(message_of([&] { apply_setting("old.kind=ab", fields, kRetired); }), HasSubstr("there is one kind"));
}

TEST(TomlBinding, WhatTheProgramWroteIsReadWithoutThem) {
  TestOptions options;
  const auto notes_of = [&](const char* text) {
    return read_toml(text, "run.toml", fields_of(options), kRetired, Retired::kLeftOut);
  };
  EXPECT_THAT(notes_of("steps = 7\n[old]\nkind = 'ab'\n[old.part]\ndecay = 0.5\n"), testing::IsEmpty());
  EXPECT_EQ(options.steps, 7);
  EXPECT_THAT(notes_of("[old]\nkind = 'rgb'\n[old.part]\ndecay = 0.5\n"),
              testing::ElementsAre("run.toml: old.kind = 'rgb' is no option any more: left out"));
}

TEST(TomlBinding, NearestNameKnowsItsLimit) {
  EXPECT_EQ(nearest_name("default", {"quick", "default"}), "default");
  EXPECT_EQ(nearest_name("qick", {"quick", "default"}), "quick");
  EXPECT_EQ(nearest_name("abcdefgh", {"quick", "default"}), "");
}

}  // namespace
}  // namespace cnerf
