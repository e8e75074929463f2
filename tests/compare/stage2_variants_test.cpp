// The comparison's other ways through stage 2.

#include "src/compare/stage2_variants.h"

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
