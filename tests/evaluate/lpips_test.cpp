#include "src/evaluate/lpips.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/evaluate/evaluate.h"
#include "src/picture/encode.h"
#include "tests/evaluate/painted_scene.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;

struct Rgb8 {
  int width = 0, height = 0;
  std::vector<std::uint8_t> values;
};

Rgb8 read_rgb(const fs::path& file) {
  cv::Mat image;
  cv::cvtColor(cv::imread(file.string()), image, cv::COLOR_BGR2RGB);
  return {image.cols, image.rows, {image.data, image.data + image.total() * 3}};
}

constexpr int kSide = 48;

/// Stripes of colours, other ones for each number.
Picture stripes(int number, int side) {
  Picture picture{side, side, {}};
  for (int i = 0; i < side * side; ++i) {
    const bool is_light = i % side / (2 + number) % 2 == 0;
    picture.rgb.insert(picture.rgb.end(), {std::uint8_t(is_light ? 200 : 30), std::uint8_t(10 * number), 90});
  }
  return picture;
}

/// A view of them that is held out.
View striped_view(const TempDir& folder, int number, int side = kSide) {
  View view;
  view.name = "view" + std::to_string(number);
  view.image_file = folder / (view.name + ".png");
  view.intrinsics.width = view.image.width = side;
  view.intrinsics.height = view.image.height = side;
  view.image.u8.assign(std::size_t(side) * std::size_t(side), 90);
  view.held_out = true;
  write_png(view.image_file, stripes(number, side));
  return view;
}

double distance(const Lpips& lpips, const Rgb8& a, const Rgb8& b) {
  return lpips.distance(a.values, b.values, a.width, a.height);
}

/// Golden values of the published code, version 0.1.
struct Golden {
  const char* weights;
  const char* network;
  double far, near;  ///< of ex_p0 and ex_p1 from ex_ref
};

class PublishedDistances : public ::testing::TestWithParam<Golden> {};
INSTANTIATE_TEST_SUITE_P(Lpips, PublishedDistances,
                         ::testing::Values(Golden{"lpips_alex_f32.bin", "AlexNet", 0.7219, 0.1376},
                                           Golden{"lpips_sq_f32.bin", "SqueezeNet", 0.71105, 0.14790}),
                         [](const auto& parameter) { return parameter.param.network; });

TEST_P(PublishedDistances, AreReached) {
  CNERF_REQUIRE_DATA(data, "lpips");
  const Lpips lpips(data / GetParam().weights);
  const Rgb8 reference = read_rgb(data / "ex_ref.png");
  EXPECT_EQ(lpips.network(), GetParam().network);
  EXPECT_NEAR(distance(lpips, read_rgb(data / "ex_p0.png"), reference), GetParam().far, 1e-4);
  EXPECT_NEAR(distance(lpips, read_rgb(data / "ex_p1.png"), reference), GetParam().near, 1e-4);
}

TEST(Lpips, IsZeroForEqualPicturesAndSymmetric) {
  CNERF_REQUIRE_DATA(data, "lpips");
  const Lpips lpips(data / "lpips_alex_f32.bin");
  const Rgb8 a = read_rgb(data / "ex_ref.png"), b = read_rgb(data / "ex_p0.png");
  EXPECT_EQ(distance(lpips, a, a), 0.0);
  EXPECT_NEAR(distance(lpips, a, b), distance(lpips, b, a), 1e-6);
}

TEST(Lpips, OfViewsMeasuredSideBySideIsThatOfEachAlone) {
  CNERF_REQUIRE_DATA(data, "lpips");
  const Lpips lpips(data / "lpips_alex_f32.bin");
  const TempDir folder;
  Capture capture;
  for (int i = 0; i < 12; ++i) capture.views.push_back(striped_view(folder, i));
  EvaluateOptions options;
  options.lpips = &lpips;
  const PaintedScene scene(0.2f, true);
  const Metrics together = evaluate(scene, capture, options);
  ASSERT_EQ(together.views.size(), 12u);
  for (int i = 0; i < 12; ++i) {
    Capture alone = capture;
    alone.views = {capture.views[std::size_t(i)]};
    EXPECT_EQ(together.views[std::size_t(i)].lpips, evaluate(scene, alone, options).views[0].lpips) << i;
    EXPECT_TRUE(i == 0 || together.views[std::size_t(i)].lpips != together.views[0].lpips) << "all are the same";
  }
}

TEST(Lpips, OfViewsThatAreTooSmallForItIsLeftOut) {
  CNERF_REQUIRE_DATA(data, "lpips");
  const Lpips lpips(data / "lpips_alex_f32.bin");
  const TempDir folder;
  Capture capture;
  capture.views = {striped_view(folder, 0), striped_view(folder, 1, Lpips::kLeastSide - 1)};
  EvaluateOptions options;
  options.lpips = &lpips;
  const Metrics metrics = evaluate(PaintedScene(0.2f, true), capture, options);
  EXPECT_TRUE(metrics.views[0].lpips);
  EXPECT_FALSE(metrics.views[1].lpips);
  EXPECT_EQ(metrics.mean.lpips, metrics.views[0].lpips);
}

TEST(Lpips, RefusesWeightsThatAreNone) {
  const TempDir folder;
  EXPECT_THROW(Lpips(folder / "missing.bin"), MissingInputError);
  write_file(folder / "net.bin", std::string(64, '\0'));
  EXPECT_THROW(Lpips(folder / "net.bin"), MissingInputError);  // no manifest
  write_file(folder / "net.txt", std::string("conv1.weight 64x3x11x11 0\n"));
  try {
    Lpips lpips(folder / "net.bin");
    FAIL() << "read beyond the end";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("conv1.weight"), std::string::npos) << error.what();
  }
  write_file(folder / "net.txt", std::string("conv1.weight 4xthree 0\n"));
  EXPECT_THROW(Lpips(folder / "net.bin"), InputError);
}

}  // namespace
}  // namespace cnerf::test
