#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "src/capture/load_capture.h"
#include "tests/capture/fixtures.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

void expect_named_ring(const Capture& capture, int count) {
  ASSERT_EQ(capture.views.size(), std::size_t(count));
  for (int i = 0; i < count; ++i) {
    const View& view = capture.views[std::size_t(i)];
    const Affined wanted = test::ring_pose(i, count);
    EXPECT_EQ(view.name, std::to_string(i) + ".png");
    EXPECT_LT(length(view.world_from_camera.translation - wanted.translation), 1e-12);
    for (int row = 0; row < 3; ++row) {
      EXPECT_LT(length(view.world_from_camera.linear.rows[row] - wanted.linear.rows[row]), 1e-12);
    }
  }
}

class Colmap : public testing::Test {
 protected:
  test::TempDir folder_;
  void SetUp() override { test::write_colmap_images(folder_ / "images"); }
};

TEST_F(Colmap, ReadsBinaryModels) {
  test::write_colmap_binary(folder_ / "sparse/0");
  const Capture capture = load_capture(folder_.path());
  EXPECT_EQ(capture.format, "colmap");
  expect_named_ring(capture, 4);
  EXPECT_EQ(capture.views[0].intrinsics.fy, 21);
  ASSERT_EQ(capture.points.size(), 2u);
  EXPECT_EQ(capture.points[1], (SparsePoint{{1.5, -1, 2}, 0.7, {0}}));
}

TEST_F(Colmap, TextSaysTheSame) {
  test::write_colmap_binary(folder_ / "sparse/0");
  const Capture binary = load_capture(folder_.path());
  std::filesystem::remove_all(folder_ / "sparse");
  test::write_colmap_text(folder_ / "sparse");
  const Capture text = load_capture(folder_.path());
  expect_named_ring(text, 4);
  EXPECT_EQ(text.points, binary.points);
  EXPECT_EQ(text.views[3].intrinsics, binary.views[3].intrinsics);
}

TEST_F(Colmap, RigsAndFramesOfNewerVersionsChangeNothing) {
  test::write_colmap_binary(folder_ / "sparse/0");
  const Capture before = load_capture(folder_.path());
  test::write_colmap_rigs_binary(folder_ / "sparse/0");
  const Capture binary = load_capture(folder_.path());
  expect_named_ring(binary, 4);
  EXPECT_EQ(binary.points, before.points);
  std::filesystem::remove_all(folder_ / "sparse");
  test::write_colmap_text(folder_ / "sparse/0");
  test::write_colmap_rigs_text(folder_ / "sparse/0");
  const Capture text = load_capture(folder_.path());
  expect_named_ring(text, 4);
  EXPECT_EQ(text.points, before.points);
  EXPECT_EQ(load_capture(folder_ / "sparse/0/rigs.txt").views.size(), 4u) << "each of its files names the model";
}

TEST_F(Colmap, PointsForgetAViewWhoseImageIsMissing) {
  test::write_colmap_binary(folder_ / "sparse/0");
  std::filesystem::remove(folder_ / "images/0.png");  // the only view of the points
  const Capture capture = load_capture(folder_.path());
  ASSERT_EQ(capture.views.size(), 3u);
  ASSERT_EQ(capture.points.size(), 2u);
  EXPECT_TRUE(capture.points[0].views.empty());
}

TEST_F(Colmap, AllPlacesAreFound) {
  for (const char* place : {".", "sparse", "sparse/0", "colmap/sparse/0"}) {
    const test::TempDir folder;
    test::write_colmap_images(folder / "images");
    test::write_colmap_binary(folder / place);
    EXPECT_EQ(load_capture(folder.path()).views.size(), 4u) << place;
    EXPECT_EQ(load_capture(folder / place).views.size(), 4u) << place;
    EXPECT_EQ(load_capture(folder / place / "images.bin").views.size(), 4u) << place;
  }
}

TEST_F(Colmap, LargestModelWins) {
  test::write_colmap_images(folder_ / "images", 7);
  test::ColmapModel model;
  model.images = 3;
  test::write_colmap_binary(folder_ / "sparse/0", model);
  model.images = 7;
  test::write_colmap_binary(folder_ / "sparse/1", model);
  model.images = 5;
  test::write_colmap_text(folder_ / "sparse/2", model);
  expect_named_ring(load_capture(folder_.path()), 7);
}

TEST_F(Colmap, DownscaleTakesReducedCopies) {
  test::write_colmap_binary(folder_ / "sparse/0");
  for (int i = 0; i < 4; ++i) {
    test::write_grey_image(folder_ / ("images_4/" + std::to_string(i) + ".png"), test::kWidth / 4, test::kHeight / 4);
  }
  CaptureOptions options;
  options.downscale = 4;
  const View view = load_capture(folder_.path(), options).views[0];
  EXPECT_EQ(view.image_file.parent_path().filename(), "images_4");
  EXPECT_EQ(view.intrinsics.fx, 5);
}

struct Model {
  test::ColmapModel stored;
  Intrinsics expected;
};
void PrintTo(const Model& model, std::ostream* out) {
  *out << model.stored.model_name;
}
class ColmapModels : public testing::TestWithParam<Model> {};

TEST_P(ColmapModels, ParametersGoToTheirPlaces) {
  for (const bool binary : {true, false}) {
    const test::TempDir folder;
    test::write_colmap_images(folder / "images");
    if (binary) test::write_colmap_binary(folder / "sparse", GetParam().stored);
    if (!binary) test::write_colmap_text(folder / "sparse", GetParam().stored);
    EXPECT_EQ(load_capture(folder.path()).views[0].intrinsics, GetParam().expected) << (binary ? "binary" : "text");
  }
}

Intrinsics expected(LensModel lens, double fy, std::array<double, 8> distortion) {
  return {lens, test::kWidth, test::kHeight, 20, fy, 8.5, 6.5, distortion};
}
INSTANTIATE_TEST_SUITE_P(
    All, ColmapModels,
    testing::Values(
        Model{{0, "SIMPLE_PINHOLE", {20, 8.5, 6.5}}, expected(LensModel::kPinhole, 20, {})},
        Model{{1, "PINHOLE", {20, 21, 8.5, 6.5}}, expected(LensModel::kPinhole, 21, {})},
        Model{{2, "SIMPLE_RADIAL", {20, 8.5, 6.5, .1}}, expected(LensModel::kOpenCv, 20, {.1})},
        Model{{3, "RADIAL", {20, 8.5, 6.5, .1, .2}}, expected(LensModel::kOpenCv, 20, {.1, .2})},
        Model{{4, "OPENCV", {20, 21, 8.5, 6.5, .1, .2, .3, .4}}, expected(LensModel::kOpenCv, 21, {.1, .2, .3, .4})},
        Model{{5, "OPENCV_FISHEYE", {20, 21, 8.5, 6.5, .1, .2, .3, .4}},
              expected(LensModel::kOpenCvFisheye, 21, {.1, .2, .3, .4})},
        Model{{6, "FULL_OPENCV", {20, 21, 8.5, 6.5, .1, .2, .3, .4, .5, .6, .7, .8}},
              expected(LensModel::kOpenCv, 21, {.1, .2, .3, .4, .5, .6, .7, .8})},
        Model{{8, "SIMPLE_RADIAL_FISHEYE", {20, 8.5, 6.5, .1}}, expected(LensModel::kOpenCvFisheye, 20, {.1})},
        Model{{9, "RADIAL_FISHEYE", {20, 8.5, 6.5, .1, .2}}, expected(LensModel::kOpenCvFisheye, 20, {.1, .2})}),
    [](const auto& name_of) { return name_of.param.stored.model_name; });

}  // namespace
}  // namespace cnerf
