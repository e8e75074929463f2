/// The dialects of transforms.json.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/load_capture.h"
#include "tests/capture/fixtures.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

class Transforms : public testing::Test {
 protected:
  test::TempDir folder_;
  json top_ = test::write_transforms(folder_.path(), 4);

  Capture load(const CaptureOptions& options = {}) {
    test::write_json(folder_ / "transforms.json", top_);
    return load_capture(folder_.path(), options);
  }
  static std::vector<std::string> names(const Capture& capture, bool held_out) {
    std::vector<std::string> out;
    for (const View& view : capture.views) {
      if (view.held_out == held_out) out.push_back(view.name);
    }
    return out;
  }
};

TEST_F(Transforms, ReadsPosesIntrinsicsAndPixels) {
  const Capture capture = load();
  EXPECT_EQ(capture.format, "transforms");
  EXPECT_EQ(capture.listed_images, 4);
  EXPECT_FALSE(capture.is_bounded_object);
  ASSERT_EQ(capture.views.size(), 4u);
  const View& view = capture.views[2];
  EXPECT_EQ(view.name, "images/2.png");
  EXPECT_EQ(view.intrinsics.fx, 20);
  EXPECT_EQ(view.intrinsics.fy, 21);
  EXPECT_EQ(view.intrinsics.cx, 8.5);
  EXPECT_EQ(view.intrinsics.cy, 5.5);
  EXPECT_EQ(view.intrinsics.model, LensModel::kPinhole);
  EXPECT_EQ(view.image.u8[3 * test::kWidth + 5], test::grey_value(5, 3, 2));
  const Affined wanted = test::ring_pose(2, 4);
  EXPECT_LT(length(view.world_from_camera.translation - wanted.translation), 1e-12);
  EXPECT_LT(length(view.world_from_camera.linear.rows[1] - wanted.linear.rows[1]), 1e-12);
}

TEST_F(Transforms, CamerasLookAtTheSubject) {
  for (const View& view : load().views) {  // the ring looks at the origin: it lands on the principal point
    const auto pixel = project(view.intrinsics, view.world_from_camera.inverse().point({0, 0, 0}));
    ASSERT_TRUE(pixel);
    EXPECT_NEAR(pixel->x, 8.5, 1e-9);
    EXPECT_NEAR(pixel->y, 5.5, 1e-9);
  }
}

TEST_F(Transforms, FrameIntrinsicsWinOverTheFiles) {
  top_["frames"][1]["fl_x"] = 33.0;
  top_["frames"][1]["cx"] = 7.25;
  const Capture capture = load();
  EXPECT_EQ(capture.views[0].intrinsics.fx, 20);
  EXPECT_EQ(capture.views[1].intrinsics.fx, 33);
  EXPECT_EQ(capture.views[1].intrinsics.cx, 7.25);
  EXPECT_EQ(capture.views[1].intrinsics.fy, 21);
}

TEST_F(Transforms, AngleOfViewGivesAFocalLength) {
  for (const char* key : {"fl_x", "fl_y", "w", "h", "cx", "cy"}) top_.erase(key);
  top_["camera_angle_x"] = 0.8;
  const Intrinsics x_only = load().views[0].intrinsics;
  EXPECT_NEAR(x_only.fx, 0.5 * test::kWidth / std::tan(0.4), 1e-12);
  EXPECT_EQ(x_only.fy, x_only.fx);
  EXPECT_EQ(x_only.cx, 8);
  EXPECT_EQ(x_only.cy, 6);
  EXPECT_EQ(x_only.width, test::kWidth);
  top_["camera_angle_y"] = 0.5;
  EXPECT_NEAR(load().views[0].intrinsics.fy, 0.5 * test::kHeight / std::tan(0.25), 1e-12);
}

TEST_F(Transforms, OpenCvDistortion) {
  top_.update({{"camera_model", "OPENCV"}, {"k1", 0.1}, {"k2", 0.2}, {"k3", 0.3}, {"p1", 0.01}, {"p2", 0.02}});
  const Intrinsics intrinsics = load().views[0].intrinsics;
  EXPECT_EQ(intrinsics.model, LensModel::kOpenCv);
  EXPECT_THAT(intrinsics.distortion, ElementsAre(0.1, 0.2, 0.01, 0.02, 0.3, 0, 0, 0));
}

TEST_F(Transforms, FisheyeDistortion) {
  top_.update({{"camera_model", "OPENCV_FISHEYE"}, {"k1", 0.1}, {"k2", 0.2}, {"k3", 0.3}, {"k4", 0.4}});
  const Intrinsics intrinsics = load().views[0].intrinsics;
  EXPECT_EQ(intrinsics.model, LensModel::kOpenCvFisheye);
  EXPECT_THAT(intrinsics.distortion, ElementsAre(0.1, 0.2, 0.3, 0.4, 0, 0, 0, 0));
  top_.erase("camera_model");
  top_["is_fisheye"] = true;  // instant-ngp's word for it
  EXPECT_EQ(load().views[0].intrinsics.model, LensModel::kOpenCvFisheye);
}

TEST_F(Transforms, ExtensionsAreTriedWhereOneIsMissing) {
  for (json& frame : top_["frames"]) {
    const std::string name = frame["file_path"];
    frame["file_path"] = "./" + name.substr(0, name.size() - 4);
  }
  test::write_grey_image(folder_ / "images/x.jpg");
  fs::rename(folder_ / "images/x.jpg", folder_ / "images/3.jpg");
  fs::remove(folder_ / "images/3.png");
  const Capture capture = load();
  ASSERT_EQ(capture.views.size(), 4u);
  EXPECT_EQ(capture.views[0].image_file.filename(), "0.png");
  EXPECT_EQ(capture.views[3].image_file.filename(), "3.jpg");
}

TEST_F(Transforms, AbsentImagesAreSkippedCountedAndNoted) {
  fs::remove(folder_ / "images/1.png");
  const Capture capture = load();
  EXPECT_EQ(capture.views.size(), 3u);
  EXPECT_EQ(capture.listed_images, 4);
  EXPECT_THAT(capture.notes, Contains(testing::AllOf(HasSubstr("1 of 4"), HasSubstr("images/1.png"))));
}

TEST_F(Transforms, HoldoutCountsSortedExistingImages) {
  std::swap(top_["frames"][0], top_["frames"][3]);  // the order of the file does not matter
  fs::remove(folder_ / "images/1.png");
  CaptureOptions options;
  options.holdout = 2;
  test::write_grey_image(folder_ / "images/4.png");
  top_["frames"].push_back(
      {{"file_path", "images/4.png"}, {"transform_matrix", test::opengl_matrix(test::ring_pose(4, 5))}});
  EXPECT_THAT(names(load(options), true), ElementsAre("images/0.png", "images/3.png"));
  EXPECT_THAT(names(load(options), false), ElementsAre("images/2.png", "images/4.png"));
}

TEST_F(Transforms, SplitListsOfNerfstudio) {
  top_["train_filenames"] = {"images/0.png", "./images/1.png"};
  top_["val_filenames"] = {"images/2.png"};
  top_["test_filenames"] = {"images/3.png"};
  const Capture capture = load();
  EXPECT_THAT(names(capture, false), ElementsAre("images/0.png", "images/1.png"));
  EXPECT_THAT(names(capture, true), ElementsAre("images/3.png"));
  EXPECT_THAT(capture.notes, Contains(HasSubstr("1 frames are in neither")));
  top_.erase("test_filenames");  // then the validation views stand in
  top_["train_filenames"].push_back("images/3.png");
  EXPECT_THAT(names(load(), true), ElementsAre("images/2.png"));
}

TEST_F(Transforms, SeparateFilesOfSyntheticSets) {
  json train = top_;
  json test = top_;
  train["frames"] = {top_["frames"][0], top_["frames"][1], top_["frames"][2]};
  test["frames"] = json::array({top_["frames"][3]});
  fs::remove(folder_ / "transforms.json");
  test::write_json(folder_ / "transforms_train.json", train);
  EXPECT_EQ(names(load_capture(folder_.path()), true).size(), 0u);
  test::write_json(folder_ / "transforms_val.json", test);
  EXPECT_THAT(names(load_capture(folder_.path()), true), ElementsAre("images/3.png"));
  test["frames"] = json::array({top_["frames"][2]});
  train["frames"].erase(2);
  test::write_json(folder_ / "transforms_train.json", train);
  test::write_json(folder_ / "transforms_test.json", test);
  EXPECT_THAT(names(load_capture(folder_.path()), true), ElementsAre("images/2.png"));
  EXPECT_THAT(names(load_capture(folder_ / "transforms_train.json"), false),
              ElementsAre("images/0.png", "images/1.png"));
}

TEST_F(Transforms, CamerasOfTrainingViewsAreToldFromOthers) {
  const json original = top_;
  const std::string given = load().cameras, of_two = load({.holdout = 3}).cameras;
  EXPECT_FALSE(given.empty());
  EXPECT_NE(of_two, given);
  EXPECT_EQ(load({.downscale = 2}).cameras, given);
  const test::TempDir elsewhere;
  fs::copy(folder_.path(), elsewhere / "moved", fs::copy_options::recursive);
  EXPECT_EQ(load_capture(elsewhere / "moved").cameras, given);

  const auto scale_positions = [&](std::size_t begin, std::size_t end, double factor) {
    for (std::size_t i = begin; i < end; ++i) {
      for (json& row : top_["frames"][i]["transform_matrix"]) row[3] = factor * double(row[3]);
      top_["frames"][i]["transform_matrix"][3][3] = 1;
    }
  };
  scale_positions(0, 4, 1 + 1e-12);
  EXPECT_EQ(load().cameras, given) << "rounding";
  top_ = original;
  scale_positions(0, 4, 2);
  EXPECT_NE(load().cameras, given);
  top_ = original;
  scale_positions(0, 1, 1.001);
  EXPECT_NE(load().cameras, given);
  EXPECT_EQ(load({.holdout = 3}).cameras, of_two) << "the first is held out";
  top_ = original;
  top_["fl_x"] = 20.01;
  EXPECT_NE(load().cameras, given);
  top_ = original;
  top_["k1"] = 0.001;
  EXPECT_NE(load().cameras, given);
}

TEST_F(Transforms, MasksHideBlackPixels) {
  cv::Mat1b mask(test::kHeight, test::kWidth, std::uint8_t(255));
  mask(2, 3) = 0;
  cv::imwrite(folder_ / "mask.png", mask);
  top_["frames"][0]["mask_path"] = "mask.png";
  const Capture capture = load();
  EXPECT_FALSE(capture.views[0].image.valid(2 * test::kWidth + 3));
  EXPECT_TRUE(capture.views[0].image.valid(2 * test::kWidth + 4));
  EXPECT_TRUE(capture.views[1].image.mask.empty());
}

TEST_F(Transforms, TransparencyEverywhereMeansABoundedObject) {
  const auto write_alpha = [&](int i) {
    cv::Mat4b image(test::kHeight, test::kWidth, cv::Vec4b(90, 90, 90, 255));
    image.rowRange(0, 3).setTo(cv::Scalar(0, 0, 0, 0));
    cv::imwrite(folder_ / ("images/" + std::to_string(i) + ".png"), image);
  };
  for (int i = 0; i < 3; ++i) write_alpha(i);
  const Capture partly = load();
  EXPECT_FALSE(partly.is_bounded_object);
  EXPECT_TRUE(partly.views[0].image.alpha.empty());
  EXPECT_FALSE(partly.views[0].image.valid(0)) << "what is transparent was not seen";
  EXPECT_TRUE(partly.views[0].image.valid(5 * test::kWidth));
  write_alpha(3);
  const Capture capture = load();
  EXPECT_TRUE(capture.is_bounded_object);
  EXPECT_EQ(capture.views[0].image.luminance(0), 0);
  EXPECT_EQ(capture.views[0].image.coverage(0), 0);
}

TEST_F(Transforms, DownscaleResizesImagesAndIntrinsics) {
  CaptureOptions options;
  options.downscale = 2;
  const View view = load(options).views[0];
  EXPECT_EQ(view.image.width, 8);
  EXPECT_EQ(view.image.height, 6);
  EXPECT_EQ(view.intrinsics.width, 8);
  EXPECT_EQ(view.intrinsics.fx, 10);
  EXPECT_EQ(view.intrinsics.cy, 2.75);
}

TEST_F(Transforms, DownscaleTakesReducedCopiesWhereThereAreSome) {
  for (int i = 0; i < 4; ++i) {
    test::write_grey_image(folder_ / ("images_2/" + std::to_string(i) + ".png"), test::kWidth / 2, test::kHeight / 2,
                           50 + i);
  }
  CaptureOptions options;
  options.downscale = 2;
  const View view = load(options).views[1];
  EXPECT_EQ(view.image_file.parent_path().filename(), "images_2");
  EXPECT_EQ(view.image.u8[0], test::grey_value(0, 0, 51));
  EXPECT_EQ(view.intrinsics.fx, 10);
  EXPECT_EQ(view.name, "images/1.png");
  const FullSizeImage full = full_size_images(folder_.path(), options).at(1);
  EXPECT_EQ(full.view, view.name);
  EXPECT_EQ(full.file.parent_path().filename(), "images");
}

TEST_F(Transforms, NumbersAreOfTheFullSizeWhereNoneIsStatedAndCopiesAreTaken) {
  for (int i = 0; i < 4; ++i) {
    test::write_grey_image(folder_ / ("images_2/" + std::to_string(i) + ".png"), test::kWidth / 2, test::kHeight / 2,
                           50 + i);
  }
  top_.erase("w");
  top_.erase("h");
  CaptureOptions options;
  options.downscale = 2;
  const View view = load(options).views[1];
  EXPECT_EQ(view.image.width, test::kWidth / 2);
  EXPECT_EQ(view.intrinsics.fx, 10);
}

TEST_F(Transforms, SmallerImagesThanStatedScaleTheCamera) {
  top_.update({{"w", 2 * test::kWidth}, {"h", 2 * test::kHeight}, {"fl_x", 40.0}});
  EXPECT_EQ(load().views[0].intrinsics.fx, 20);
}

TEST_F(Transforms, SmallPoseErrorsAreRepairedAndNoted) {
  top_["frames"][0]["transform_matrix"][0][0] = double(top_["frames"][0]["transform_matrix"][0][0]) + 2e-3;
  EXPECT_THAT(load().notes, Contains(HasSubstr("1 of 4 poses")));
}

TEST_F(Transforms, HintsArePassedOn) {
  top_["aabb"] = {{-1, -2, -3}, {1, 2, 3}};
  top_["applied_transform"] = {{1, 0, 0, 0}, {0, 0, 1, 0}, {0, -1, 0, 0}};
  const Capture capture = load();
  ASSERT_TRUE(capture.bounds);
  EXPECT_EQ(capture.bounds->max, (Vec3d{1, 2, 3}));
  EXPECT_THAT(capture.notes, Contains(HasSubstr("applied_transform")));
}

TEST_F(Transforms, ColourImagesAreNoted) {
  cv::imwrite(folder_ / "images/0.png", cv::Mat(test::kHeight, test::kWidth, CV_8UC3, cv::Scalar(10, 200, 90)));
  EXPECT_THAT(load().notes, Contains(HasSubstr("1 of 4 images have colours")));
}

TEST_F(Transforms, CommentsAreAllowed) {
  write_file(folder_ / "transforms.json", "// by hand\n" + top_.dump());
  EXPECT_EQ(load_capture(folder_.path()).views.size(), 4u);
}

}  // namespace
}  // namespace cnerf
