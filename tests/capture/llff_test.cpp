#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "src/base/error.h"
#include "src/capture/load_capture.h"
#include "tests/capture/fixtures.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

using testing::Contains;
using testing::HasSubstr;

TEST(Llff, ColumnsAreDownRightBack) {
  const test::TempDir folder;
  test::write_llff(folder.path());
  const Capture capture = load_capture(folder.path());
  EXPECT_EQ(capture.format, "llff");
  ASSERT_EQ(capture.views.size(), 4u);
  for (int i = 0; i < 4; ++i) {
    const Affined& pose = capture.views[std::size_t(i)].world_from_camera;
    const Affined wanted = test::ring_pose(i, 4);
    EXPECT_LT(length(pose.translation - wanted.translation), 1e-12);
    for (int row = 0; row < 3; ++row) EXPECT_LT(length(pose.linear.rows[row] - wanted.linear.rows[row]), 1e-12);
  }
}

TEST(Llff, CentreIsThePrincipalPointAndBoundsSpanAllViews) {
  const test::TempDir folder;
  test::write_llff(folder.path());
  const Capture capture = load_capture(folder.path());
  EXPECT_EQ(capture.views[0].intrinsics.cx, 8);
  EXPECT_EQ(capture.views[0].intrinsics.cy, 6);
  EXPECT_EQ(capture.views[0].intrinsics.fx, 20);
  ASSERT_TRUE(capture.depth_range);
  EXPECT_EQ(capture.depth_range->near, 2);
  EXPECT_EQ(capture.depth_range->far, 12);
}

TEST(Llff, ReducedFoldersAreChosenByDownscale) {
  const test::TempDir folder;
  test::write_llff(folder.path(), 4, "images_4", 4, 3);
  test::write_llff(folder.path(), 4, "images_2", 8, 6);
  CaptureOptions options;
  options.downscale = 2;
  EXPECT_EQ(load_capture(folder.path(), options).views[0].intrinsics.fx, 10);
  options.downscale = 4;
  const View view = load_capture(folder.path(), options).views[0];
  EXPECT_EQ(view.intrinsics.fx, 5);
  EXPECT_EQ(view.name, "images_4/img0.png");
}

TEST(Llff, CamerasOfReducedFoldersAreTheSame) {
  const test::TempDir folder;
  test::write_llff(folder.path(), 4, "images_4", 4, 3);
  test::write_llff(folder.path(), 4, "images_2", 8, 6);
  EXPECT_EQ(load_capture(folder.path(), {.downscale = 4}).cameras,
            load_capture(folder.path(), {.downscale = 2}).cameras);
}

TEST(Llff, WithoutFullSizeImagesTheLargestAreTaken) {
  const test::TempDir folder;
  test::write_llff(folder.path(), 4, "images_4", 4, 3);
  test::write_llff(folder.path(), 4, "images_2", 8, 6);
  const Capture capture = load_capture(folder.path());
  EXPECT_EQ(capture.views[0].image.width, 8);
  EXPECT_EQ(capture.views[0].intrinsics.fx, 10);
  EXPECT_THAT(capture.notes, Contains(HasSubstr("1/2 size")));
}

TEST(Llff, SaysThatTheLensIsUnknown) {
  const test::TempDir folder;
  test::write_llff(folder.path(), 4, "images", 8, 6);
  EXPECT_THAT(load_capture(folder.path()).notes, Contains(HasSubstr("knows no lens")));
}

TEST(Llff, TheRestOfADownscaleIsResized) {
  const test::TempDir folder;
  test::write_llff(folder.path(), 4, "images_2", 8, 6);
  CaptureOptions options;
  options.downscale = 4;
  const View view = load_capture(folder.path(), options).views[0];
  EXPECT_EQ(view.image.width, 4);
  EXPECT_EQ(view.image.height, 3);
  EXPECT_EQ(view.intrinsics.fx, 5);
}

TEST(Llff, FullSizeImagesAreThoseOfTheLargestFolder) {
  const test::TempDir folder;
  test::write_llff(folder.path(), 4, "images_4", 4, 3);
  test::write_llff(folder.path(), 4, "images_2", 8, 6);
  for (const int downscale : {1, 2, 4, 8}) {
    CaptureOptions options;
    options.downscale = downscale;
    const Capture capture = load_capture(folder.path(), options);
    const std::vector<FullSizeImage> images = full_size_images(folder.path(), options);
    ASSERT_EQ(images.size(), 4u);
    for (std::size_t i = 0; i < images.size(); ++i) {
      EXPECT_EQ(images[i].view, capture.views[i].name);
      EXPECT_EQ(images[i].file, folder / "images_2" / ("img" + std::to_string(i) + ".png")) << downscale;
    }
  }
}

TEST(Llff, FortranOrderedPosesAreTheSame) {
  const test::TempDir folder;
  test::write_llff(folder.path());
  const Capture wanted = load_capture(folder.path());
  const std::vector<double> rows = test::llff_rows(4);
  std::vector<double> columns;
  for (std::size_t c = 0; c < 17; ++c) {
    for (std::size_t r = 0; r < 4; ++r) columns.push_back(rows[r * 17 + c]);
  }
  test::write_npy(folder / "poses_bounds.npy", "<f8", true, "4, 17", test::bytes_of(columns));
  EXPECT_EQ(load_capture(folder.path()).views[3].world_from_camera, wanted.views[3].world_from_camera);
}

TEST(Llff, IsTakenWhereAModelBesideItIsIncomplete) {
  const test::TempDir folder;
  test::write_llff(folder.path());
  test::write_colmap_binary(folder / "sparse/0");
  std::filesystem::remove(folder / "sparse/0/images.bin");
  const Capture capture = load_capture(folder.path());
  EXPECT_EQ(capture.format, "llff");
  EXPECT_THAT(capture.notes, Contains(testing::AllOf(HasSubstr("poses_bounds.npy is taken"), HasSubstr("images.bin"))));
}

TEST(Llff, WhereNothingIsWholeThePreferredPosesAreNamed) {
  const test::TempDir folder;
  test::write_llff(folder.path());
  test::truncate_file(folder / "poses_bounds.npy", 0.5);
  test::write_colmap_binary(folder / "sparse/0");
  std::filesystem::remove(folder / "sparse/0/images.bin");
  try {
    (void)load_capture(folder.path());
    FAIL() << "no poses were whole";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("images.bin"));
  }
}

}  // namespace
}  // namespace cnerf
