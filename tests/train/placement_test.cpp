// Where the field's box lies.

#include "src/train/luminance/placement.h"

#include <gtest/gtest.h>

#include "src/base/error.h"
#include "tests/support/toy_capture.h"

namespace cnerf {
namespace {

TEST(Placement, TakesTheCentreThatIsGiven) {
  const Capture capture = test::toy_capture(6);
  const SceneFrame chosen = place_scene(capture, {});
  const SceneFrame given = place_scene(capture, {.cascades = 2, .centre = "1,-2.5,3e-1"});
  EXPECT_EQ(given.world_centre.x, 1);
  EXPECT_EQ(given.world_centre.y, -2.5);
  EXPECT_EQ(given.world_centre.z, 0.3);
  EXPECT_EQ(given.cascades, 2);
  EXPECT_EQ(given.unit_per_world, chosen.unit_per_world);
  for (const char* text : {"1,2", "1,2,x", "1,2,3,4", "1 2 3"}) {
    EXPECT_THROW((void)place_scene(capture, {.cascades = 0, .centre = text}), UsageError) << text;
  }
}

}  // namespace
}  // namespace cnerf
