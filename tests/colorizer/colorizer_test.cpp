#include "src/colorizer/colorizer.h"

#include <cmath>
#include <limits>

#include "src/base/files.h"
#include "src/color/ab_bins.h"
#include "src/colorizer/kinds.h"
#include "tests/colorizer/questions.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

using test::message_of;
using test::some_question;
using ::testing::AllOf;
using ::testing::Each;
using ::testing::HasSubstr;

TEST(Colorizer, GreyAnswersNoChroma) {
  const auto grey = test::colorizer_of("grey");
  const LightnessBatch question = some_question();
  const ChromaBatch answer = grey->colorize(question);
  EXPECT_NO_THROW(check_answer("grey", question, answer));
  EXPECT_EQ(answer.ab.size(), 2 * question.lightness.size());
  EXPECT_THAT(answer.ab, Each(0.0f));
}

TEST(Colorizer, UnknownKindIsAUsageErrorThatListsTheKinds) {
  for (const char* spec : {"", "gray", "torch:x", ":x"}) {
    const std::string message = message_of<UsageError>([&] { test::colorizer_of(spec); });
    for (const char* kind : {"builtin", "reference", "torchscript", "onnx", "caffe", "exec", "grey"}) {
      EXPECT_THAT(message, HasSubstr(kind)) << spec;
    }
  }
}

TEST(Colorizer, KindsThatNeedAnArgumentSayWhich) {
  EXPECT_THAT(message_of<UsageError>([] { test::colorizer_of("exec"); }), HasSubstr("exec:COMMAND"));
  EXPECT_THAT(message_of<UsageError>([] { test::colorizer_of("torchscript:"); }), HasSubstr("torchscript:FILE"));
  EXPECT_THAT(message_of<UsageError>([] { test::colorizer_of("grey:x"); }), HasSubstr("grey"));
}

TEST(Colorizer, MissingFilesAreNamed) {
  for (const char* spec : {"reference:no_such.jpg", "torchscript:no_such.pt"}) {
    ColorizerOptions options;
    options.spec = spec;
    EXPECT_THAT(message_of<MissingInputError>([&] {
                  (void)make_colorizer(options, {"/no/such/folder", {}, 1, {}});
                }),
                AllOf(HasSubstr("no_such"), HasSubstr("/no/such/folder")));
  }
}

TEST(Colorizer, NamesInAListOfFilesMayHoldCommas) {
  using Files = std::vector<std::filesystem::path>;
  const test::TempDir folder;
  const Files three = {folder / "Paris, 1910/a.png", folder / "c.png", folder / "Paris, 1910/b.png"};
  for (const auto& file : three) write_file(file, "");
  std::filesystem::create_directory(folder / "Paris");
  const auto found = [&](const std::string& list) {
    ColorizerOptions options;
    options.spec = "reference:" + list;
    const ColorizerContext context{folder.path(), {}, 1, {}};
    return find_spec_files({list, options, context});
  };
  EXPECT_EQ(found("Paris, 1910/a.png,c.png,,Paris, 1910/b.png"), three);
  EXPECT_EQ(found(three[0].string() + "," + three[1].string() + "," + three[2].string()), three);
  EXPECT_EQ(found("Paris, 1910"), Files{folder / "Paris, 1910"});
  EXPECT_THAT(message_of<MissingInputError>([&] { (void)found("none, 1.png,c.png"); }), HasSubstr("no file none, nor"));
  std::string many;
  for (int i = 0; i < 60; ++i) many += "c.png,";
  EXPECT_EQ(found(many).size(), 60u) << "longer than a file's name may be";
}

ChromaBatch good_answer(const LightnessBatch& question) {
  ChromaBatch answer{question.batch, question.height, question.width, {}, {}};
  answer.ab.assign(2 * question.lightness.size(), 1.0f);
  return answer;
}

TEST(CheckAnswer, AcceptsAbAndDistributions) {
  const LightnessBatch question = some_question();
  ChromaBatch answer = good_answer(question);
  EXPECT_NO_THROW(check_answer("x", question, answer));
  answer.ab.clear();
  answer.logits.assign(kAbBinCount * question.lightness.size(), 0.0f);
  EXPECT_NO_THROW(check_answer("x", question, answer));
}

TEST(CheckAnswer, RefusesWhatIsWrongAndNamesTheColorizer) {
  const LightnessBatch question = some_question();
  const auto refused = [&](auto&& spoil) {
    ChromaBatch answer = good_answer(question);
    spoil(answer);
    const std::string message = message_of<ColorizerError>([&] { check_answer("exec:x", question, answer); });
    EXPECT_THAT(message, HasSubstr("exec:x"));
  };
  refused([](ChromaBatch& a) { a.batch = 1; });
  refused([](ChromaBatch& a) { std::swap(a.height, a.width); });
  refused([](ChromaBatch& a) { a.ab.pop_back(); });
  refused([](ChromaBatch& a) { a.ab.clear(); });
  refused([](ChromaBatch& a) { a.logits.assign(a.ab.size() / 2 * kAbBinCount, 0.0f); });
  refused([](ChromaBatch& a) { a.ab[3] = std::numeric_limits<float>::quiet_NaN(); });
  refused([](ChromaBatch& a) { a.ab.back() = std::numeric_limits<float>::infinity(); });
}

TEST(CheckAnswer, RefusesACertaintyOutsideZeroToOne) {
  const LightnessBatch question = some_question();
  ChromaBatch answer{
      question.batch, question.height, question.width, std::vector<float>(2 * question.lightness.size()), {}};
  answer.certainty.assign(question.lightness.size(), 0.5f);
  EXPECT_NO_THROW(check_answer("here", question, answer));
  for (const float wrong : {0.0f, -0.5f, 1.5f, std::numeric_limits<float>::quiet_NaN()}) {
    answer.certainty.back() = wrong;
    EXPECT_THAT(message_of<ColorizerError>([&] { check_answer("here", question, answer); }), HasSubstr("certainty"));
  }
  answer.certainty.back() = 0.5f;
  answer.certainty.pop_back();
  EXPECT_THAT(message_of<ColorizerError>([&] { check_answer("here", question, answer); }), HasSubstr("certainty"));
}

TEST(CertaintyOf, TakesTheEntryAsked) {
  const ChromaBatch answer{2, 1, 2, std::vector<float>(8), {}, {0.1f, 0.2f, 0.3f, 0.4f}};
  EXPECT_THAT(certainty_of(answer, 1), ::testing::ElementsAre(0.3f, 0.4f));
  EXPECT_THAT(certainty_of({2, 1, 2, std::vector<float>(8), {}}, 1), ::testing::IsEmpty());
}

TEST(CertaintyOf, ReadsADistributionPerPixel) {
  ChromaBatch answer{2, 1, 2, {}, std::vector<float>(4 * kAbBinCount, 0)};
  answer.logits[2 * kAbBinCount + 2 * 7] = 1000;  // of the second entry's first pixel: bin 7 alone
  const std::vector<float> certainty = certainty_of(answer, 1);
  ASSERT_EQ(certainty.size(), 2u);
  EXPECT_FLOAT_EQ(certainty[0], 1);
  EXPECT_NEAR(certainty[1], 1.0 / kAbBinCount, 1e-7);
  EXPECT_NEAR(certainty_of(answer, 0)[0], 1.0 / kAbBinCount, 1e-7);
}

TEST(AbOf, TakesTheEntryAsked) {
  ChromaBatch answer{2, 1, 2, {1, 2, 3, 4, 5, 6, 7, 8}, {}};
  EXPECT_THAT(ab_of(answer, 1), ::testing::ElementsAre(5, 6, 7, 8));
  EXPECT_THROW((void)ab_of(answer, 2), ContractError);
}

TEST(AbOf, DecodesADistributionPerPixel) {
  ChromaBatch answer{1, 1, 2, {}, std::vector<float>(2 * kAbBinCount, 0.0f)};
  const int first = 40, second = 200;
  answer.logits[std::size_t(2 * first)] = 100;       // pixel 0
  answer.logits[std::size_t(2 * second + 1)] = 100;  // pixel 1
  const std::vector<float> ab = ab_of(answer, 0);
  const auto& centres = ab_bin_centres();
  EXPECT_NEAR(ab[0], centres[first].a, 1e-3);
  EXPECT_NEAR(ab[1], centres[second].a, 1e-3);
  EXPECT_NEAR(ab[2], centres[first].b, 1e-3);
  EXPECT_NEAR(ab[3], centres[second].b, 1e-3);
}

}  // namespace
}  // namespace cnerf
