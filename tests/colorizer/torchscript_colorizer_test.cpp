// torchscript: colorizers compiled here: every contract, and every way of being bad.

#include <ATen/Parallel.h>
#include <caffe2/serialize/inline_container.h>
#include <sys/resource.h>
#include <torch/script.h>

#include <filesystem>

#include "src/base/files.h"
#include "src/base/parallel.h"
#include "tests/colorizer/questions.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

using test::message_of;
using test::some_question;
using ::testing::AllOf;
using ::testing::HasSubstr;

class TorchScriptColorizer : public ::testing::Test {
 protected:
  /// Saves a module whose forward is `body`, with the TOML text beside it.
  std::string module_of(const std::string& body, const std::string& toml = "") {
    const auto file = folder_ / ("module" + std::to_string(++count_) + ".pt");
    torch::jit::Module module("m");
    module.define("def forward(self, x):\n" + body);
    module.save(file.string());
    if (!toml.empty()) write_file(file.string() + ".toml", toml);
    return "torchscript:" + file.string();
  }
  /// A module whose records `change(name, bytes)` had.
  template <typename Change>
  std::string changed_module(const Change& change) {
    const std::string good = module_of("    return torch.cat([x - 50, -x], 1)\n"), bad = folder_ / "changed.pt";
    caffe2::serialize::PyTorchStreamReader reader(good.substr(good.find(':') + 1));
    caffe2::serialize::PyTorchStreamWriter writer(bad);
    for (const std::string& name : reader.getAllRecords()) {
      if (name == "version") continue;  // is written by itself
      const auto [data, size] = reader.getRecord(name);
      std::string bytes(static_cast<const char*>(data.get()), size);
      change(name, bytes);
      writer.writeRecord(name, bytes.data(), bytes.size());
    }
    writer.writeEndOfFile();
    return "torchscript:" + bad;
  }
  std::string failure_of(const std::string& spec) {
    return message_of<ColorizerError>([&] { (void)test::colorizer_of(spec)->colorize(some_question()); });
  }
  test::TempDir folder_;
  int count_ = 0;
};

constexpr const char* kShift = "    return torch.cat([x - 50, -x], 1)\n";

TEST_F(TorchScriptColorizer, AsksInLightnessAndAnswersAb) {
  const auto colorizer = test::colorizer_of(module_of(kShift));
  const LightnessBatch question = some_question();
  const ChromaBatch answer = colorizer->colorize(question);
  check_answer("torchscript", question, answer);
  const std::vector<float> second = ab_of(answer, 1);
  EXPECT_FLOAT_EQ(second[3], question.lightness[33] - 50);
  EXPECT_FLOAT_EQ(second[33], -question.lightness[33]);
}

TEST_F(TorchScriptColorizer, LibTorchHasNoMoreThreadsThanTheProgram) {
  const std::string spec = module_of(kShift);
  (void)test::colorizer_of(spec);
  const int on_all_cores = at::get_num_threads();
  set_thread_count(1);
  (void)test::colorizer_of(spec);
  EXPECT_EQ(at::get_num_threads(), 1);
  set_thread_count(0);
  (void)test::colorizer_of(spec);
  EXPECT_EQ(at::get_num_threads(), on_all_cores);
}

TEST_F(TorchScriptColorizer, InputUnitsAsDeclared) {
  const LightnessBatch question = some_question();
  const auto first_a = [&](const std::string& toml) {
    return test::colorizer_of(module_of("    return torch.cat([x, x], 1)\n", toml))->colorize(question).ab[7];
  };
  const float lightness = question.lightness[7];
  EXPECT_FLOAT_EQ(first_a("input = \"L100\""), lightness);
  EXPECT_FLOAT_EQ(first_a("input = \"L01\""), lightness / 100);
  EXPECT_FLOAT_EQ(first_a("input = \"L-50\""), lightness - 50);
  EXPECT_FLOAT_EQ(first_a("input = \"L-1\""), lightness / 50 - 1);
  const auto rgb = test::colorizer_of(module_of("    return x[:, 0:2]\n", "input = \"rgb01\""));
  LightnessBatch middle = question;
  std::fill(middle.lightness.begin(), middle.lightness.end(), 53.585f);  // sRGB 128
  EXPECT_NEAR(rgb->colorize(middle).ab[0], 128 / 255.0, 1e-4);
}

TEST_F(TorchScriptColorizer, OutputKindsAsDeclared) {
  const LightnessBatch question = some_question();
  const auto ab1 = test::colorizer_of(module_of("    return torch.cat([x, x], 1) * 0 + 0.5\n", "output = \"ab1\""));
  EXPECT_FLOAT_EQ(ab1->colorize(question).ab[0], 55);
  const auto logits =
      test::colorizer_of(module_of("    return x.repeat([1, 313, 1, 1])\n", "output = \"logits313\"\ninput = \"L01\""));
  EXPECT_TRUE(logits->colorize(question).has_distribution());
  // Red, whatever the lightness: its Lab is (53.241, 80.094, 67.203).
  const auto rgb =
      test::colorizer_of(module_of("    return torch.cat([x * 0 + 1, x * 0, x * 0], 1)\n", "output = \"rgb01\""));
  const ChromaBatch answer = rgb->colorize(question);
  EXPECT_NEAR(answer.ab[0], 80.094, 0.05);
  EXPECT_NEAR(answer.ab[30], 67.203, 0.05);
}

TEST_F(TorchScriptColorizer, SizesAreBroughtBackToTheQuestion) {
  const LightnessBatch question = some_question(2, 10, 13);
  const std::string strided = "    y = torch.avg_pool2d(x, [4, 4])\n    return torch.cat([y, y], 1)\n";
  const auto padded = test::colorizer_of(module_of(strided, "multiple_of = 8"));
  EXPECT_NO_THROW(check_answer("x", question, padded->colorize(question)));
  const std::string fixed =
      "    assert x.size(2) == 32 and x.size(3) == 32, \"wrong size\"\n"
      "    return torch.cat([x, x], 1)\n";
  const auto resized = test::colorizer_of(module_of(fixed, "size = 32"));
  const ChromaBatch answer = resized->colorize(question);
  EXPECT_NO_THROW(check_answer("x", question, answer));
  EXPECT_NEAR(answer.ab[65], question.lightness[65], 1.5) << "up and down again";
}

TEST_F(TorchScriptColorizer, AWrongShapeIsExplained) {
  EXPECT_THAT(failure_of(module_of("    return x\n")), AllOf(HasSubstr("[2, 1, 6, 5]"), HasSubstr("toml")));
  EXPECT_THAT(failure_of(module_of("    return x.sum()\n")), HasSubstr("[]"));
  EXPECT_THAT(failure_of(module_of("    return (x, x)\n")), HasSubstr("tensor"));
}

TEST_F(TorchScriptColorizer, FailuresOfTheModuleAreNamed) {
  EXPECT_THAT(failure_of(module_of("    assert x.size(1) == 3, \"no such mood\"\n    return x\n")),
              AllOf(HasSubstr("module1.pt"), HasSubstr("[2, 1, 6, 5]"), HasSubstr("no such mood")));
  EXPECT_THAT(failure_of(module_of("    return torch.cat([x, x / 0.0 * 0.0], 1)\n")), HasSubstr("nan"));
}

/// In a process of its own: the thread that never ends goes with it.
TEST_F(TorchScriptColorizer, AScriptThatNeverEndsIsAnErrorInTime) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto ask = [&] {
    const std::string endless = module_of("    while bool((x == x).all()):\n        x = x + 1\n    return x\n");
    try {
      (void)test::colorizer_of(endless, 0.3)->colorize(some_question());
    } catch (const ColorizerError& error) {
      std::fprintf(stderr, "%s\n", error.what());
      std::_Exit(int(error.exit_code()));
    }
    std::_Exit(0);
  };
  EXPECT_EXIT(ask(), testing::ExitedWithCode(int(ExitCode::kColorizer)), "gave no answer within 0.3 s");
}

TEST_F(TorchScriptColorizer, FilesThatAreNoModules) {
  const std::string whole = module_of(kShift).substr(std::string("torchscript:").size());
  const std::vector<std::byte> bytes = read_binary_file(whole);
  const auto cut = (folder_ / "cut.pt").string();
  write_file(cut, std::span(bytes).first(bytes.size() / 2));
  EXPECT_THAT(failure_of("torchscript:" + cut), HasSubstr("cut.pt"));
  write_file(cut, "hello");
  EXPECT_THAT(failure_of("torchscript:" + cut), HasSubstr("cut.pt"));
  EXPECT_THAT(message_of<MissingInputError>([] { test::colorizer_of("torchscript:nowhere.pt"); }),
              HasSubstr("nowhere.pt"));
}

TEST_F(TorchScriptColorizer, AWrongContractFileIsNamedWithItsKey) {
  for (const auto& [toml, expected] : std::vector<std::pair<std::string, std::string>>{{"input = \"L255\"", "input"},
                                                                                       {"output = 3", "output"},
                                                                                       {"size = -1", "size"},
                                                                                       {"siez = 3", "siez"},
                                                                                       {"size = [", "line 1"}}) {
    const std::string spec = module_of(kShift, toml);
    EXPECT_THAT(message_of<InputError>([&] { test::colorizer_of(spec); }),
                AllOf(HasSubstr(".toml"), HasSubstr(expected)));
  }
}

/// Its parser calls itself for each bracket, until there is no stack left.
TEST_F(TorchScriptColorizer, AFileThatEndsLibTorchIsRefused) {
  const auto deep = [](const std::string& name, std::string& bytes) {
    if (name == "code/__torch__.py") bytes.insert(bytes.find("return ") + 7, std::string(1'000'000, '('));
  };
  EXPECT_THAT(failure_of(changed_module(deep)), HasSubstr("is damaged"));
}

/// A pickle may say at which place of a table a value lies, and LibTorch makes the table that long.
TEST_F(TorchScriptColorizer, AFileOfWhichLibTorchMakesGigabytesIsRefused) {
  const auto far_place = [](const std::string& name, std::string& bytes) {
    if (name == "data.pkl") bytes = std::string("\x80\x02]r\xff\xff\xff\x07.");
  };
  EXPECT_THAT(failure_of(changed_module(far_place)), HasSubstr("is damaged"));
  rusage own{}, children{};
  ::getrusage(RUSAGE_SELF, &own);
  ::getrusage(RUSAGE_CHILDREN, &children);
  EXPECT_LT(std::max(own.ru_maxrss, children.ru_maxrss), 1L << 20) << "KiB";
}

}  // namespace
}  // namespace cnerf
