#include "src/studio/known_strokes.h"

#include <gtest/gtest.h>

#include <array>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "src/base/error.h"
#include "tests/train/wall_views.h"

namespace cnerf::studio {
namespace {

using test::look;

class KnownStrokesTest : public ::testing::Test {
 protected:
  KnownStrokesTest() : views_{look(0.45f, true), look(0.55f, true)}, seen_(views_, names_) {
    Stroke stroke{.id = "a", .view = "left", .color = "#c04030", .size = 0.1f};
    stroke.points = {{0.2f, 0.5f, 1}, {0.8f, 0.5f, 1}};
    list_.strokes = {stroke};
  }

  std::vector<std::string> names_ = {"left", "right"};
  std::vector<CachedView> views_;
  SeenSurfaces seen_;
  StrokeList list_;
};

TEST_F(KnownStrokesTest, AreWhatSourcesMakeKnown) {
  for (const bool everywhere : {false, true}) {
    list_.everywhere = everywhere;
    const std::vector<KnownColors> painted = known_of(list_, seen_);
    const KnownColorMap expected(seen_, KnownColorSources(seen_, painted));
    const KnownStrokes strokes(list_, seen_);
    const KnownColorMap map = strokes.map(2);
    ASSERT_FALSE(expected.places().empty());
    ASSERT_EQ(map.places().size(), expected.places().size());
    for (const ViewPixel& place : expected.places()) {
      const Ab *ours = map.find(place.view, place.pixel), *theirs = expected.find(place.view, place.pixel);
      ASSERT_NE(ours, nullptr);
      ASSERT_EQ(ours->a, theirs->a);
      ASSERT_EQ(ours->b, theirs->b);
    }
    EXPECT_LT(strokes.map(1).places().size(), map.places().size()) << "of the first view alone";
  }
}

TEST_F(KnownStrokesTest, EachViewIsLookedAtOnceWhoeverAsks) {
  const KnownStrokes strokes(list_, seen_);
  std::array<KnownColorMap::OfView, 4> answers;
  std::vector<std::thread> threads;
  for (auto& answer : answers) threads.emplace_back([&] { answer = strokes.in(1); });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(std::set(answers.begin(), answers.end()).size(), 1u);
  EXPECT_NE(answers.front(), nullptr);
}

TEST_F(KnownStrokesTest, AreOfAListByWhatIsPainted) {
  const KnownStrokes strokes(list_, seen_);
  StrokeList other = list_;
  other.revision = 7;
  EXPECT_TRUE(strokes.is_of(other));
  other.everywhere = true;
  EXPECT_FALSE(strokes.is_of(other));
  other = list_;
  other.strokes[0].color = "#30c040";
  EXPECT_FALSE(strokes.is_of(other));
}

TEST_F(KnownStrokesTest, WithoutStrokesNothingIsKnown) {
  EXPECT_TRUE(KnownStrokes({}, seen_).map(2).places().empty());
}

}  // namespace
}  // namespace cnerf::studio
