/// Colours of the input cannot reach a result: two captures of different colours and identical converted greys give
/// the same snapshots, bit for bit.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <opencv2/imgcodecs.hpp>

#include "src/base/files.h"
#include "src/base/rng.h"
#include "src/capture/color_truth.h"
#include "src/capture/load_capture.h"
#include "src/color/colorspace_math.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;

struct Color8 {
  int r = 0, g = 0, b = 0;
};

/// The 8-bit grey code of a colour, before rounding.
double grey_code(Color8 color) {
  const auto linear = [](int v) { return linear_from_srgb(v / 255.0); };
  return 255 * srgb_from_linear(luminance_of(Vec3d{linear(color.r), linear(color.g), linear(color.b)}));
}

/// For each grey code the reddest and the bluest colour found that converts to it, away from where rounding decides.
struct Palette {
  std::array<Color8, 256> red, blue;

  Palette() {
    for (int v = 0; v < 256; ++v) red[v] = blue[v] = {v, v, v};
    const CounterRng rng(1, 1);
    for (std::uint64_t i = 0; i < 200000; ++i) {
      const Color8 color = {int(rng.below(3 * i, 256)), int(rng.below(3 * i + 1, 256)), int(rng.below(3 * i + 2, 256))};
      const double code = grey_code(color);
      const auto whole = std::size_t(std::lround(code));
      if (std::abs(code - double(whole)) > 0.3) continue;
      if (color.r - color.b > red[whole].r - red[whole].b) red[whole] = color;
      if (color.b - color.r > blue[whole].b - blue[whole].r) blue[whole] = color;
    }
  }
};

/// Replaces the grey images of a capture by colours of the same greys, and drops the ground truth beside them.
void paint(const fs::path& capture, const std::array<Color8, 256>& colors) {
  fs::remove_all(capture / "color");
  for (const auto& entry : fs::directory_iterator(capture / "images")) {
    const cv::Mat grey = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
    cv::Mat painted(grey.rows, grey.cols, CV_8UC3);
    for (int y = 0; y < grey.rows; ++y) {
      for (int x = 0; x < grey.cols; ++x) {
        const Color8 color = colors[grey.at<std::uint8_t>(y, x)];
        painted.at<cv::Vec3b>(y, x) = cv::Vec3b(std::uint8_t(color.b), std::uint8_t(color.g), std::uint8_t(color.r));
      }
    }
    cv::imwrite(entry.path().string(), painted);
  }
}

/// A red and a blue capture, and a run of the red one.
class ColorLeak : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<TempDir>();
    const Palette palette;
    paint(copied(tiny_capture(), path("red")), palette.red);
    paint(copied(tiny_capture(), path("blue")), palette.blue);
    fs::copy_file(tiny_capture() / "references/view_001.png", path("reference.png"));
    train("red");
  }
  static void TearDownTestSuite() { shared_.reset(); }

  /// Trains NAME-run on the capture NAME.
  static void train(const std::string& name) {
    const ProgramResult trained =
        cnerf(concatenated({"train", path(name).string(), "-o", path(name + "-run").string()}, tiny_options()));
    ASSERT_EQ(trained.exit_code, 0) << trained.err;
  }

  static fs::path path(const std::string& name) { return *shared_ / name; }

  inline static std::unique_ptr<TempDir> shared_;
};

TEST_F(ColorLeak, TheCapturesDifferInColourAndNotInGrey) {
  const Capture red = load_capture(path("red")), blue = load_capture(path("blue"));
  ASSERT_EQ(red.views.size(), blue.views.size());
  for (std::size_t i = 0; i < red.views.size(); ++i) {
    EXPECT_EQ(red.views[i].image.u8, blue.views[i].image.u8);
    EXPECT_NE(load_color_truth(red.views[i])->rgb, load_color_truth(blue.views[i])->rgb);
  }
}

TEST_F(ColorLeak, BothGiveTheSameSnapshotsByteForByte) {
  train("blue");
  for (const char* run : {"red-run", "blue-run"}) {
    // The reference is the same file for both: its fit, which takes the longest here, is done once.
    if (run == std::string("blue-run")) fs::copy(path("red-run/cache"), path("blue-run/cache"));
    const ProgramResult colorized = cnerf(
        {"colorize", path(run).string(), "--take", "t", "--colorizer", "reference:" + path("reference.png").string()});
    ASSERT_EQ(colorized.exit_code, 0) << colorized.err;
  }
  EXPECT_TRUE(read_binary_file(path("red-run/stage1.snapshot")) == read_binary_file(path("blue-run/stage1.snapshot")));
  EXPECT_TRUE(read_binary_file(path("red-run/takes/t/take.snapshot")) ==
              read_binary_file(path("blue-run/takes/t/take.snapshot")));
}

/// The comparison can fail: other grey values change the snapshot.
TEST_F(ColorLeak, AnotherGreyGivesAnotherSnapshot) {
  const fs::path changed = copied(path("red"), path("changed"));
  for (const auto& entry : fs::directory_iterator(changed / "images")) {
    cv::Mat image = cv::imread(entry.path().string());
    image += cv::Scalar(40, 40, 40);
    cv::imwrite(entry.path().string(), image);
  }
  train("changed");
  EXPECT_TRUE(read_binary_file(path("red-run/stage1.snapshot")) !=
              read_binary_file(path("changed-run/stage1.snapshot")));
}

}  // namespace
}  // namespace cnerf::test
