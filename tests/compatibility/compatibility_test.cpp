/// Files of earlier versions, opened by the program of today: it reads them, or refuses them by name.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "src/base/files.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

/// A copy of what one version wrote, since the program writes beside what it reads.
class Compatibility : public testing::Test {
 protected:
  Compatibility() { fs::copy(kept_, folder_.path(), fs::copy_options::recursive); }

  [[nodiscard]] std::string path(const std::string& name) const { return (folder_ / name).string(); }

  /// Calls the program on the run, whose capture has moved.
  [[nodiscard]] ProgramResult on_run(const std::string& command, const std::vector<std::string>& options) const {
    return cnerf(concatenated({command, path("run"), "--capture", path("capture"), "--device", "cpu"}, options));
  }

  const fs::path kept_ = fs::path(CNERF_SOURCE_DIR) / "tests/compatibility/649cb93";
  const TempDir folder_;
};

/// Mean absolute difference of two pictures, in codes of 8 bits.
double difference(const fs::path& a, const fs::path& b) {
  const cv::Mat first = cv::imread(a.string()), second = cv::imread(b.string());
  EXPECT_FALSE(first.empty()) << a;
  EXPECT_EQ(first.size(), second.size()) << b;
  return cv::norm(first, second, cv::NORM_L1) / double(first.total() * 3);
}

TEST_F(Compatibility, InfoDescribesCaptureRunSnapshotsAndVolume) {
  const auto info = [&](const std::string& name) {
    const ProgramResult result = cnerf({"info", path(name)});
    EXPECT_EQ(result.exit_code, 0) << name << ": " << result.err;
    return result.out;
  };
  EXPECT_THAT(info("capture"), AllOf(HasSubstr("transforms"), HasSubstr("9 of 9 listed, 2 held out")));
  EXPECT_THAT(info("run"), AllOf(HasSubstr("cnerf 0.1.0"), HasSubstr("400 steps"), HasSubstr("24 patches accepted")));
  EXPECT_THAT(info("run/stage1.snapshot"), HasSubstr("(-1.451, -1.451, -1.331) to (1.451, 1.451, 1.571)"));
  EXPECT_THAT(info("run/takes/reference/take.snapshot"), HasSubstr("reference:capture/references/view_001.png"));
  EXPECT_THAT(info("run/bakes/reference/volume.vdb"),
              AllOf(HasSubstr("cnerf_resolution: [20, 20, 20]"), HasSubstr("voxels of 0.1814"), HasSubstr("luminance"),
                    HasSubstr("lab_a"), HasSubstr("inferred by a colorizer")));
}

TEST_F(Compatibility, ATakeRendersTheSamePictures) {
  const ProgramResult result = on_run("render", {"--path", "held-out", "--format", "png", "-o", path("now")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  for (const char* view : {"held-out/images_view_000.png", "held-out/images_view_008.png"}) {
    // Other compilers round otherwise; another formula moves a picture by whole codes.
    EXPECT_LT(difference(kept_ / "pictures" / view, folder_ / "now" / view), 0.1) << view;
  }
  EXPECT_GT(difference(kept_ / "pictures/held-out/images_view_000.png", folder_ / "now/held-out/images_view_008.png"),
            5)
      << "the measure can fail";
}

TEST_F(Compatibility, EvaluationFindsTheSameNumbers) {
  const auto means = [](const fs::path& file) { return nlohmann::json::parse(read_text_file(file)).at("mean"); };
  const auto before = means(kept_ / "run/metrics.json");
  fs::remove(folder_ / "run/metrics.json");
  const ProgramResult result = on_run("eval", {});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto now = means(folder_ / "run/metrics.json");
  for (const char* name : {"psnr_luminance", "psnr_rgb", "ssim", "ab_error", "bake_ab_distance"}) {
    EXPECT_NEAR(now.at(name).get<double>(), before.at(name).get<double>(), 0.01) << name;
  }
}

TEST_F(Compatibility, ARunIsBakedToTheSameVolume) {
  const ProgramResult result = on_run("bake", {"--resolution", "20", "-o", path("now")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto volume = [](const fs::path& folder) {
    return nlohmann::json::parse(read_text_file(folder / "manifest.json")).at("volume");
  };
  const auto before = volume(kept_ / "run/bakes/reference"), now = volume(folder_ / "now");
  EXPECT_EQ(now.at("resolution"), before.at("resolution"));
  EXPECT_NEAR(now.at("voxels").get<double>(), before.at("voxels").get<double>(), 5);  // at a threshold
  const double densest = before.at("max_density").get<double>();
  // Its products were of floats; those of bf16 are off by 2^-8.
  EXPECT_NEAR(now.at("max_density").get<double>(), densest, 4e-3 * densest);
}

TEST_F(Compatibility, AnOldRunTakesNewColours) {
  const ProgramResult result = on_run(
      "colorize", concatenated({"--take", "again", "--colorizer", "reference:" + path("capture/color/view_001.png")},
                               tiny_options()));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(cnerf({"info", path("run")}).out, AllOf(HasSubstr("again: "), HasSubstr("reference: ")));
}

TEST_F(Compatibility, ABakeIsReadByItsManifest) {
  const ProgramResult result = cnerf({"render", path("run/bakes/reference"), "-o", path("now")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  for (const char* view : {"cameras/images_view_000.png", "cameras/images_view_008.png"}) {
    EXPECT_LT(difference(kept_ / "voxels" / view, folder_ / "now" / view), 0.1) << view;
  }
}

TEST_F(Compatibility, AWebBundleIsShown) {
  const ProgramResult shown =
      cnerf_interrupted_at({"view", path("run/bakes/reference/web"), "--no-browser"}, "Ctrl-C ends it");
  EXPECT_EQ(shown.exit_code, 0) << shown.err;
  EXPECT_EQ(read_text_file(folder_ / "run/bakes/reference/web/bundle.json"),
            read_text_file(kept_ / "run/bakes/reference/web/bundle.json"));
}

TEST_F(Compatibility, OptionsOfAnOldRunAreReadOrAnsweredByName) {
  const ProgramResult result = cnerf(
      {"train", path("capture"), "-o", path("now"), "--config", path("run/config.toml"), "--set", "stage1.steps=2"});
  if (result.exit_code == 0) return;
  EXPECT_EQ(result.exit_code, 64) << result.err;
  EXPECT_THAT(result.err, AllOf(HasSubstr("config.toml"), testing::ContainsRegex("[a-z0-9]+\\.[a-z_]+")));
}

}  // namespace
}  // namespace cnerf::test
