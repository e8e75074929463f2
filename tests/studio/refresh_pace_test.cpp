#include "src/studio/refresh_pace.h"

#include <gtest/gtest.h>

namespace cnerf::studio {
namespace {

/// Times of refreshes, where each takes so long to draw.
int refreshes(double drawing, double seconds, double* drawn = nullptr) {
  RefreshPace pace;
  int count = 0;
  double all = 0;
  for (double now = 0; now < seconds; now += 0.01) {
    if (!pace.is_due(now)) continue;
    ++count;
    pace.drew(drawing);
    now += drawing;
    all += drawing;
  }
  if (drawn != nullptr) *drawn = all / seconds;
  return count;
}

TEST(RefreshPace, TheFirstChangeShowsSoon) {
  RefreshPace pace;
  EXPECT_FALSE(pace.is_due(RefreshPace::kBeforeFirst / 2));
  EXPECT_TRUE(pace.is_due(RefreshPace::kBeforeFirst));
  EXPECT_FALSE(pace.is_due(RefreshPace::kBeforeFirst + 0.01));
}

TEST(RefreshPace, DrawingTakesAQuarterOfTheTimeAtMost) {
  double share = 0;
  EXPECT_EQ(refreshes(0.01, 10), 10);
  EXPECT_LE(refreshes(0.6, 10, &share), 5);
  EXPECT_LE(share, 1 / RefreshPace::kLeastPerDrawn + 0.06);  // the last one's time is not over yet
  EXPECT_GE(refreshes(5, 100), 5);
}

}  // namespace
}  // namespace cnerf::studio
