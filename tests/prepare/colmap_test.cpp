// Real COLMAP on the real captures, whose own poses are the truth.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "src/base/error.h"
#include "src/base/process.h"
#include "src/base/usage.h"
#include "src/capture/load_capture.h"
#include "src/prepare/prepare.h"
#include "src/sample/sample_scene.h"
#include "tests/support/data.h"
#include "tests/support/no_programs.h"
#include "tests/support/pose_comparison.h"

namespace cnerf::prepare {
namespace {
namespace fs = std::filesystem;

#define CNERF_REQUIRE_COLMAP() \
  if (!find_program("colmap")) GTEST_SKIP() << "needs colmap on $PATH"
#define CNERF_REQUIRE_PATIENCE() \
  if (std::getenv("CNERF_LONG_TESTS") == nullptr) GTEST_SKIP() << "takes many minutes; set CNERF_LONG_TESTS=1"

/// The first `most` images of a capture in grey, without their poses.
void write_grey_copies(const fs::path& from, const fs::path& to, double scale, std::size_t most = 1000) {
  fs::create_directories(to);
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(from)) files.push_back(entry.path());
  std::ranges::sort(files);
  files.resize(std::min(files.size(), most));
  for (const fs::path& file : files) {
    cv::Mat image = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
    if (scale != 1) cv::resize(image, image, {}, scale, scale, cv::INTER_AREA);
    cv::imwrite((to / file.stem()).string() + ".png", image);
  }
}

PrepareReport prepare(const fs::path& source, const fs::path& out, const PrepareOptions& options = {}) {
  return prepare_capture(source, out, options, {}, [](const std::string& line) { std::puts(line.c_str()); });
}

test::PoseComparison compare_with(const fs::path& truth_folder, const fs::path& prepared) {
  std::map<std::string, Affined> truth;
  for (const View& view : load_capture(truth_folder).views) {
    truth[fs::path(view.name).stem().string()] = view.world_from_camera;
  }
  std::vector<Affined> found, given;
  for (const View& view : load_capture(prepared).views) {
    found.push_back(view.world_from_camera);
    given.push_back(truth.at(fs::path(view.name).stem().string()));
  }
  const test::PoseComparison out = test::compare_poses(found, given);
  std::printf("%zu views; largest differences: %.3f degrees, %.3f %% of the capture's size\n", found.size(),
              *std::ranges::max_element(out.rotation_degrees), 100 * *std::ranges::max_element(out.centre_errors));
  return out;
}

TEST(Colmap, FindsThePosesOfAFewSmallViews) {
  CNERF_REQUIRE_COLMAP();
  CNERF_REQUIRE_DATA(fox, "scenes/fox");
  const test::TempDir folder;
  write_grey_copies(fox / "images", folder / "photos", 0.25, 12);
  EXPECT_EQ(prepare(folder / "photos", folder / "capture").registered, 12u);
  const test::PoseComparison poses = compare_with(fox, folder / "capture");
  // COLMAP draws its samples anew each time: 1.5 to 2.1 degrees were seen.
  for (const double degrees : poses.rotation_degrees) EXPECT_LT(degrees, 4);
  for (const double error : poses.centre_errors) EXPECT_LT(error, 0.05);
}

/// A circle around a subject, of which nothing tells the lens, trades focal lengths against the shape of the scene.
TEST(Colmap, FindsTheLensOfAnOrbit) {
  CNERF_REQUIRE_COLMAP();
  const test::TempDir folder;
  SampleSceneOptions options;
  options.path = "orbit";
  options.views = 36;
  options.width = 400;
  options.height = 300;
  options.samples_per_pixel = 4;
  write_sample_scene(folder / "sample", options);
  write_grey_copies(folder / "sample" / "images", folder / "photos", 1);
  EXPECT_EQ(prepare(folder / "photos", folder / "capture").registered, 36u);
  const Intrinsics truth = load_capture(folder / "sample").views.front().intrinsics;
  const Intrinsics found = load_capture(folder / "capture").views.front().intrinsics;
  std::printf("focal lengths %.1f, %.1f; true %.1f\n", found.fx, found.fy, truth.fx);
  // One run of COLMAP is not the next: 1 to 3 % were seen.
  EXPECT_NEAR(found.fx / truth.fx, 1, 0.06);
  EXPECT_NEAR(found.fy / truth.fx, 1, 0.06);
  const test::PoseComparison poses = compare_with(folder / "sample", folder / "capture");
  for (const double degrees : poses.rotation_degrees) EXPECT_LT(degrees, 1.5);
  for (const double error : poses.centre_errors) EXPECT_LT(error, 0.02);
}

TEST(Colmap, FindsThePosesOfFox) {
  CNERF_REQUIRE_PATIENCE();
  CNERF_REQUIRE_COLMAP();
  CNERF_REQUIRE_DATA(fox, "scenes/fox");
  const test::TempDir folder;
  write_grey_copies(fox / "images", folder / "photos", 0.5);
  const Stopwatch watch;
  const PrepareReport report = prepare(folder / "photos", folder / "capture");
  std::printf("%.0f s\n", watch.seconds());
  EXPECT_EQ(report.registered, 50u);
  const test::PoseComparison poses = compare_with(fox, folder / "capture");
  for (const double degrees : poses.rotation_degrees) EXPECT_LT(degrees, 0.5);
  for (const double error : poses.centre_errors) EXPECT_LT(error, 0.01);
}

TEST(Colmap, FindsThePosesOfFlower) {
  CNERF_REQUIRE_PATIENCE();
  CNERF_REQUIRE_COLMAP();
  CNERF_REQUIRE_DATA(flower, "scenes/flower");
  const test::TempDir folder;
  write_grey_copies(flower / "images_4", folder / "photos", 1);
  EXPECT_EQ(prepare(folder / "photos", folder / "capture").registered, 34u);
  const Capture capture = load_capture(folder / "capture");
  EXPECT_TRUE(capture.depth_range) << "all cameras look one way";
}

TEST(Colmap, PhotographsWithoutOverlapAreRefusedWithAdvice) {
  CNERF_REQUIRE_COLMAP();
  const test::TempDir folder;
  for (int i = 0; i < 4; ++i) {
    cv::Mat1b noise(240, 320);
    cv::theRNG().state = std::uint64_t(1000 + i);
    cv::randu(noise, 0, 255);
    cv::GaussianBlur(noise, noise, {0, 0}, 2);
    fs::create_directories(folder / "photos");
    cv::imwrite((folder / ("photos/" + std::to_string(i) + ".png")).string(), noise);
  }
  try {
    (void)prepare(folder / "photos", folder / "capture");
    FAIL() << "not refused";
  } catch (const PosesError& error) {
    EXPECT_NE(std::string(error.what()).find("two thirds"), std::string::npos) << error.what();
  }
  EXPECT_FALSE(fs::exists(folder / "capture/transforms.json"));
  EXPECT_TRUE(fs::exists(folder / "capture" / "work" / "colmap.log"));
}

/// Needs no COLMAP: what is said where there is none.
TEST(NoColmap, SaysHowToInstallItAndKeepsTheImages) {
  const test::TempDir folder;
  fs::create_directories(folder / "photos");
  for (const char* name : {"a.png", "b.png"}) {
    cv::imwrite((folder / "photos" / name).string(), cv::Mat1b(40, 60, std::uint8_t(99)));
  }
  const test::NoPrograms none;
  try {
    (void)prepare(folder / "photos", folder / "capture", PrepareOptions{});
    FAIL() << "not refused";
  } catch (const DeviceError& error) {
    EXPECT_NE(std::string(error.what()).find("apt install colmap"), std::string::npos) << error.what();
  }
  EXPECT_TRUE(fs::exists(folder / "capture/images/a.png"));
}

}  // namespace
}  // namespace cnerf::prepare
