#include "src/prepare/capture_writer.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/rng.h"
#include "src/capture/load_capture.h"
#include "src/color/colorspace_math.h"
#include "src/picture/encode.h"
#include "tests/support/data.h"
#include "tests/support/pose_comparison.h"

namespace cnerf::prepare {
namespace {

std::vector<View> views_of(LensModel model, bool two_cameras) {
  SequentialRng rng(1, 0);
  std::vector<View> views;
  for (int i = 0; i < 4; ++i) {
    View view;
    view.name = "v" + std::to_string(i) + ".png";
    view.intrinsics = {model, 16, 12, 20, 21, 8.5, 6.25, {0.1, -0.02, 0.001, -0.002}};
    if (model == LensModel::kPinhole) view.intrinsics.distortion = {};
    if (two_cameras && i > 1) view.intrinsics.fx = 25;
    const Vec3d axis = normalized(Vec3d{double(rng.normal()), double(rng.normal()), double(rng.normal())});
    view.world_from_camera = {rotation_between({0, 0, 1}, axis), axis * 3.0};
    views.push_back(view);
  }
  return views;
}

std::vector<PreparedImage> write_images(const std::filesystem::path& folder, const std::vector<View>& views,
                                        bool mask) {
  std::vector<PreparedImage> images;
  for (const View& view : views) {
    write_png(folder / "images" / view.name,
              cv::Mat1b(view.intrinsics.height, view.intrinsics.width, std::uint8_t(90)));
    PreparedImage image;
    image.name = view.name;
    image.exposure = 1 + 0.25 * double(images.size());
    if (mask) {
      image.mask = std::filesystem::path("masks") / view.name;
      cv::Mat1b black_corner(12, 16, std::uint8_t(255));
      black_corner(0, 0) = 0;
      write_png(folder / image.mask, black_corner);
    }
    images.push_back(image);
  }
  return images;
}

TEST(CaptureWriter, WhatIsWrittenReadsBack) {
  for (const LensModel model : {LensModel::kPinhole, LensModel::kOpenCv, LensModel::kOpenCvFisheye}) {
    for (const bool two_cameras : {false, true}) {
      const test::TempDir folder;
      const std::vector<View> views = views_of(model, two_cameras);
      const auto images = write_images(folder.path(), views, true);
      const SubjectBox subject = {{{-1, -2, -3}, {1, 2, 3}}, true, 0.5, 9};
      write_file(folder / "transforms.json", transforms_json(views, images, subject).dump());
      const Capture capture = load_capture(folder.path());
      ASSERT_EQ(capture.views.size(), views.size());
      for (std::size_t i = 0; i < views.size(); ++i) {
        EXPECT_EQ(capture.views[i].intrinsics, views[i].intrinsics);
        const Affined difference = capture.views[i].world_from_camera.inverse() * views[i].world_from_camera;
        EXPECT_LT(test::rotation_angle(difference.linear) + length(difference.translation), 1e-12);
        const float light = linear_from_srgb(90 / 255.0f);
        EXPECT_NEAR(capture.views[i].image.luminance(5), light / (1 + 0.25 * double(i)), 1e-7);
        EXPECT_FALSE(capture.views[i].image.valid(0));
        EXPECT_TRUE(capture.views[i].image.valid(1));
      }
      ASSERT_TRUE(capture.bounds && capture.depth_range);
      EXPECT_EQ(*capture.bounds, subject.box);
      EXPECT_EQ(capture.depth_range->near, 0.5);
      EXPECT_EQ(capture.depth_range->far, 9);
    }
  }
}

TEST(CaptureWriter, ALensOfAnotherKindIsReadBackAsSuch) {
  for (const std::size_t fisheye : {0u, 3u}) {
    const test::TempDir folder;
    std::vector<View> views = views_of(LensModel::kOpenCv, false);
    views[fisheye].intrinsics = views_of(LensModel::kOpenCvFisheye, false)[fisheye].intrinsics;
    const auto images = write_images(folder.path(), views, false);
    write_file(folder / "transforms.json", transforms_json(views, images, std::nullopt).dump());
    const Capture capture = load_capture(folder.path());
    for (std::size_t i = 0; i < views.size(); ++i) EXPECT_EQ(capture.views[i].intrinsics, views[i].intrinsics) << i;
  }
}

TEST(CaptureWriter, PointsKeepTheirErrorsAndTheViewsThatShowThem) {
  const test::TempDir folder;
  std::vector<View> views = views_of(LensModel::kPinhole, false);
  const auto images = write_images(folder.path(), views, false);
  std::swap(views[0], views[3]);  // frames need not be in the order of their names
  const std::vector<SparsePoint> points = {{{0.123456789, -2, 3e-5}, 0.75, {0, 2, 3}}, {{1, 2, 3}, 1.5, {1}}};
  write_file(folder / "transforms.json", transforms_json(views, images, std::nullopt, true).dump());
  EXPECT_THROW((void)load_capture(folder.path()), MissingInputError) << "the file is named, and not there";
  write_file(folder / kPointsFile, points_text(points));
  Capture capture = load_capture(folder.path());
  ASSERT_EQ(capture.points.size(), 2u);
  EXPECT_EQ(capture.points[0], (SparsePoint{points[0].position, 0.75, {0, 2, 3}})) << "views 3 and 0 changed places";
  EXPECT_EQ(capture.points[1], points[1]);
  std::filesystem::remove(folder / "images/v2.png");
  capture = load_capture(folder.path());
  EXPECT_EQ(capture.points[0].views, (std::vector<std::uint32_t>{0, 2})) << "the third view is gone";
  write_file(folder / kPointsFile, std::string_view("1 0 x 0\n"));
  EXPECT_THROW((void)load_capture(folder.path()), InputError);
}

TEST(CaptureWriter, RationalLensesAreRefusedNotRounded) {
  std::vector<View> views = views_of(LensModel::kOpenCv, false);
  views[2].intrinsics.distortion[5] = 0.1;
  EXPECT_THROW((void)transforms_json(views, {}, std::nullopt), InputError);
}

TEST(CaptureWriter, ContactSheetShowsTheBoxInTheViews) {
  const test::TempDir folder;
  std::vector<View> views = views_of(LensModel::kPinhole, false);
  for (View& view : views) view.world_from_camera = {Mat3d::identity(), {0, 0, -6}};
  (void)write_images(folder.path(), views, false);
  const auto colored = [&](const std::optional<SubjectBox>& subject) {
    write_contact_sheet(folder / "sheet.png", folder.path(), views, {{0, 0, 0}}, subject);
    const cv::Mat3b sheet = cv::imread((folder / "sheet.png").string());
    int count = 0;  // pixels of the box's yellow, below the plans, where the views are
    for (int y = 490; y < sheet.rows; ++y) {
      for (int x = 0; x < sheet.cols; ++x) count += sheet(y, x)[2] > sheet(y, x)[0] + 60 ? 1 : 0;
    }
    return count;
  };
  EXPECT_EQ(colored(std::nullopt), 0);
  EXPECT_GT(colored(SubjectBox{{{-1, -1, -1}, {1, 1, 1}}, false, 0, 0}), 20);
}

}  // namespace
}  // namespace cnerf::prepare
