#include "src/capture/color_truth.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "src/capture/load_capture.h"
#include "src/color/colorspace_math.h"
#include "tests/capture/fixtures.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;

const cv::Scalar kBgr(30, 200, 90);

class ColorTruth : public testing::Test {
 protected:
  test::TempDir folder_;
  void SetUp() override { (void)test::write_transforms(folder_.path()); }
  void write_color(const std::string& file) {
    fs::create_directories((folder_ / file).parent_path());
    cv::imwrite(folder_ / file, cv::Mat(test::kHeight, test::kWidth, CV_8UC3, kBgr));
  }
  std::optional<ColorImage> truth_of_first(int downscale = 1) {
    return load_color_truth(load_capture(folder_.path(), {.downscale = downscale}).views[0]);
  }
  static void expect_color(const ColorImage& image) {
    EXPECT_NEAR(image.rgb[0], linear_from_srgb(90 / 255.0), 1e-5);
    EXPECT_NEAR(image.rgb[1], linear_from_srgb(200 / 255.0), 1e-5);
    EXPECT_NEAR(image.rgb[2], linear_from_srgb(30 / 255.0), 1e-5);
  }
};

TEST_F(ColorTruth, GreyImagesHaveNone) {
  EXPECT_FALSE(truth_of_first());
}

TEST_F(ColorTruth, ColourImagesAreTheirOwn) {
  write_color("images/0.png");
  const auto truth = truth_of_first();
  ASSERT_TRUE(truth);
  EXPECT_EQ(truth->width, test::kWidth);
  expect_color(*truth);
}

TEST_F(ColorTruth, IsResizedToTheView) {
  write_color("images/0.png");
  const auto truth = truth_of_first(2);
  ASSERT_TRUE(truth);
  EXPECT_EQ(truth->width, test::kWidth / 2);
  EXPECT_EQ(truth->rgb.size(), 3u * 8 * 6);
  expect_color(*truth);
}

TEST_F(ColorTruth, SiblingFolderColorHoldsItForGreyImages) {
  write_color("color/0.png");
  const auto truth = truth_of_first();
  ASSERT_TRUE(truth);
  expect_color(*truth);
  EXPECT_FALSE(load_color_truth(load_capture(folder_.path()).views[1]));
}

TEST_F(ColorTruth, SiblingOfAnotherShapeIsRefused) {
  fs::create_directories(folder_ / "color");
  cv::imwrite(folder_ / "color/0.png", cv::Mat(9, 9, CV_8UC3, kBgr));
  EXPECT_THROW((void)truth_of_first(), InputError);
}

TEST_F(ColorTruth, AnyImageLoadsAtFullSize) {
  write_color("any.png");
  const ColorImage image = load_color_image(folder_ / "any.png");
  EXPECT_EQ(image.height, test::kHeight);
  expect_color(image);
  const ColorImage grey = load_color_image(folder_ / "images/0.png");
  EXPECT_EQ(grey.rgb.size(), 3u * test::kWidth * test::kHeight);
  EXPECT_EQ(grey.rgb[3], grey.rgb[5]);
  EXPECT_THROW((void)load_color_image(folder_ / "none.png"), MissingInputError);
}

}  // namespace
}  // namespace cnerf
