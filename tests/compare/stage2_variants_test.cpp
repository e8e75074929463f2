// The comparison's other ways through stage 2.

#include "src/compare/stage2_variants.h"

#include <array>

#include "src/train/chroma/key_views.h"
#include "tests/support/stage2_fixture.h"

namespace cnerf::compare {
namespace {
using test::kAnswer;
using test::Listening;
using Stage2Variants = test::Stage2Fixture;

TEST_F(Stage2Variants, ViewsAreAskedAboutWholeAndOnceFromNeighbourToNeighbour) {
  Listening colorizer;
  ViewQuestions questions;
  (void)colorize(small_options(), colorizer, take("a"), nullptr, &questions);
  std::vector<std::string> asked;
  for (const PatchOrigin& origin : colorizer.origins) {
    asked.push_back(origin.view);
    EXPECT_EQ(origin.width, 1);
    EXPECT_EQ(origin.height, 1);
  }
  // Six cameras on a circle; the sixth is held out.
  EXPECT_EQ(asked, (std::vector<std::string>{"toy0", "toy1", "toy2", "toy3", "toy4"}));
}

/// Answers a colour per size of the question, and keeps the sizes.
class Sized final : public Colorizer {
 public:
  ChromaBatch colorize(const LightnessBatch& patches) override {
    sides.push_back(std::min(patches.width, patches.height));
    ChromaBatch answer{patches.batch, patches.height, patches.width, {}, {}};
    answer.ab.assign(2 * patches.lightness.size(), float(sides.back()));
    return answer;
  }
  [[nodiscard]] std::string name() const override { return "sized"; }
  std::vector<int> sides;
};

TEST_F(Stage2Variants, SeveralSizesAreAskedAboutAndPatchesTakeTheirAnswersInTurns) {
  /// What patches were told.
  struct Told final : Questions {
    void prepare(Session& session) override { sizes.prepare(session); }
    void answer(const Session& session, std::span<AnsweredPatch> patches) override {
      sizes.answer(session, patches);
      for (const AnsweredPatch& patch : patches) told[patch.place.index % 3].push_back(patch.ab.front());
    }
    ViewQuestions sizes{3};
    std::array<std::vector<float>, 3> told;
  };
  Sized colorizer;
  Told questions;
  (void)colorize(small_options(), colorizer, take("a"), nullptr, &questions);
  // Views of 48 x 40; a question has at most twice the side of a patch, 16.
  std::vector<int> expected;
  for (int view = 0; view < 5; ++view) expected.insert(expected.end(), {32, 16, 8});
  EXPECT_EQ(colorizer.sides, expected);
  for (std::size_t size = 0; size < 3; ++size) {
    ASSERT_FALSE(questions.told[size].empty());
    for (const float side : questions.told[size]) EXPECT_NEAR(side, 32 >> size, 1e-4);
  }
}

TEST_F(Stage2Variants, TheKeyViewIsTheOneThatTellsMostOfTheOthers) {
  Listening colorizer;
  ViewCache views;
  (void)colorize(small_options(), colorizer, take("a"), &views);
  const SeenSurfaces seen(views.views(), views.names());
  const auto alone = choose_key_views(seen, scene_points(seen), {}, 1).alone;
  const LightnessBatch question = key_view(views);
  EXPECT_EQ(question.width, 48);
  EXPECT_EQ(question.height, 40);
  const auto best = std::ranges::max_element(alone, {}, &KeyView::adds);
  EXPECT_EQ(question.origins.front().view, views.names()[best->view]);
}

TEST_F(Stage2Variants, LearnTheAnswer) {
  const Photometric photometric;
  ViewQuestions whole_views;
  const auto learns = [&](const std::string& name, Questions* questions, const Injection* injection) {
    Listening colorizer;
    (void)colorize(small_options(), colorizer, take(name), nullptr, questions, injection);
    EXPECT_LT(distance_to_answer(name), 5) << name << "; grey is " << std::hypot(kAnswer.a, kAnswer.b);
  };
  learns("photometric", nullptr, &photometric);
  learns("views", &whole_views, nullptr);
  learns("both", &whole_views, &photometric);
}

}  // namespace
}  // namespace cnerf::compare
