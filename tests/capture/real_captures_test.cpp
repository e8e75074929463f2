/// Captures as people made them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "src/capture/arrangement.h"
#include "src/capture/color_truth.h"
#include "src/capture/load_capture.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

using testing::Contains;
using testing::HasSubstr;

long held_out(const Capture& capture) {
  return std::count_if(capture.views.begin(), capture.views.end(), [](const View& v) { return v.held_out; });
}

TEST(RealCaptures, FoxListsMoreImagesThanItHas) {
  CNERF_REQUIRE_DATA(folder, "scenes/fox");
  const Capture capture = load_capture(folder, {.downscale = 8, .holdout = 8});
  EXPECT_EQ(capture.listed_images, 67);
  EXPECT_EQ(capture.views.size(), 50u);
  EXPECT_EQ(held_out(capture), 7);
  EXPECT_TRUE(capture.views[0].held_out);
  EXPECT_TRUE(capture.views[8].held_out);
  EXPECT_THAT(capture.notes, Contains(HasSubstr("17 of 67")));
  EXPECT_EQ(capture.views[0].intrinsics.model, LensModel::kOpenCv);
  EXPECT_EQ(capture.views[0].image.width, 135);
  EXPECT_FALSE(arrangement_of(capture).forward_facing);
  EXPECT_TRUE(load_color_truth(capture.views[3]));
}

TEST(RealCaptures, FlowerTakesTheFolderOfItsSize) {
  CNERF_REQUIRE_DATA(folder, "scenes/flower");
  const Capture capture = load_capture(folder, {.downscale = 8, .holdout = 8});
  EXPECT_EQ(capture.views.size(), 34u);
  EXPECT_EQ(held_out(capture), 5);
  EXPECT_EQ(capture.views[0].image.width, 504);
  EXPECT_EQ(capture.views[0].image_file.parent_path().filename(), "images_8");
  ASSERT_TRUE(capture.depth_range);
  EXPECT_GT(capture.depth_range->far, capture.depth_range->near);
  EXPECT_TRUE(arrangement_of(capture).forward_facing);
}

TEST(RealCaptures, LegoIsABoundedObjectWithATestSplit) {
  CNERF_REQUIRE_DATA(folder, "scenes/lego");
  const Capture capture = load_capture(folder, {.downscale = 4});
  EXPECT_EQ(capture.views.size(), 125u);
  EXPECT_EQ(held_out(capture), 25);
  EXPECT_TRUE(capture.is_bounded_object);
  EXPECT_FALSE(arrangement_of(capture).forward_facing);
  for (const View& view : capture.views) {  // the model stands at the origin, and every camera sees it
    const auto pixel = project(view.intrinsics, view.world_from_camera.inverse().point({0, 0, 0}));
    ASSERT_TRUE(pixel);
    EXPECT_NEAR(pixel->x, 50, 1);
    EXPECT_NEAR(pixel->y, 50, 1);
  }
}

TEST(RealCaptures, RobovisionIsMonochromeWithIntrinsicsOfEachFrame) {
  CNERF_REQUIRE_DATA(folder, "scenes/robovision");
  const Capture capture = load_capture(folder, {.downscale = 4});
  EXPECT_EQ(capture.views.size(), 12u);
  EXPECT_NE(capture.views[0].intrinsics.fx, capture.views[1].intrinsics.fx);
  EXPECT_FALSE(capture.is_bounded_object);
  EXPECT_FALSE(arrangement_of(capture).forward_facing);
  const MonoImage& image = capture.views[0].image;
  EXPECT_FALSE(image.valid(0)) << "alpha hides the border that undistorting left";
  EXPECT_TRUE(image.valid(image.pixel_count() / 2 + std::size_t(image.width) / 2));
  EXPECT_FALSE(load_color_truth(capture.views[0]));
}

TEST(RealCaptures, FruitIsSeenFromAllAround) {
  CNERF_REQUIRE_DATA(folder, "scenes/fruit");
  EXPECT_FALSE(arrangement_of(load_capture(folder, {.downscale = 8})).forward_facing);
}

}  // namespace
}  // namespace cnerf
