#include "src/pipeline/photographs_step.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/color/colorspace_math.h"
#include "src/pipeline/colorize_step.h"
#include "src/pipeline/train_step.h"
#include "src/sample/sample_scene.h"
#include "tests/support/data.h"
#include "tests/support/exif_jpeg.h"
#include "tests/support/tiny_config.h"

namespace cnerf::pipeline {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// Answers one colour, more vivid than sRGB has at most lightnesses.
class Vivid final : public Colorizer {
 public:
  ChromaBatch colorize(const LightnessBatch& patches) override {
    const std::size_t pixels = patches.lightness.size() / std::size_t(patches.batch);
    ChromaBatch answer{patches.batch, patches.height, patches.width, {}, {}};
    for (int i = 0; i < patches.batch; ++i) {
      answer.ab.insert(answer.ab.end(), pixels, 70.0f);
      answer.ab.insert(answer.ab.end(), pixels, 50.0f);
    }
    return answer;
  }
  [[nodiscard]] std::string name() const override { return "vivid"; }
};

Config vivid_config() {
  Config config = test::tiny_config();
  config.stage2.patches = 60;
  config.stage2.patch_size = 32;
  config.stage2.rays_per_patch = 256;
  config.stage2.distill_steps = 10;
  config.stage2.purify.enabled = false;
  return config;
}

/// A picture of the sample capture, 10 times as large and with 16 bits of grain, so that its chroma is brought up.
void enlarge(const fs::path& file) {
  cv::Mat image = cv::imread(file.string(), cv::IMREAD_UNCHANGED), large;
  image.convertTo(image, CV_16U, 257);
  cv::resize(image, large, {}, 10, 10, cv::INTER_CUBIC);
  cv::Mat grain(large.size(), large.type());
  cv::theRNG().state = 1;
  cv::randn(grain, cv::Scalar::all(500), cv::Scalar::all(200));
  large -= grain;
  ASSERT_TRUE(cv::imwrite(file.string(), large));
}

constexpr const char* kLarge = "view_003";

/// A capture of six views, one of them large, and a run with a take "vivid".
class Photographs : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<test::TempDir>();
    write_sample_scene(capture(), {.views = 6, .width = 96, .height = 72, .samples_per_pixel = 1});
    enlarge(capture() / "images" / (std::string(kLarge) + ".png"));
    const RunContext context = run();
    begin_run(context, capture(), {});
    train_step(context, {}, cpu_engines(), silent());
    Vivid vivid;
    colorize_step(context, {"vivid", {}, &vivid}, cpu_engines(), silent());
  }
  static void TearDownTestSuite() { shared_.reset(); }

  static fs::path capture() { return *shared_ / "capture"; }
  static Observer& silent() {
    static Observer observer;
    return observer;
  }
  static RunContext run(const fs::path& from = capture()) {
    const Config config = vivid_config();
    return {RunDirectory(*shared_ / "run"), config, read_capture(from, config, silent()), {}};
  }
  static std::vector<fs::path> written(const PhotographsJob& job, Observer& observer = silent()) {
    return photographs_step(run(), job, cpu_engines(), observer);
  }

  const test::TempDir out_;
  inline static std::unique_ptr<test::TempDir> shared_;
};

/// What two pictures of the same pixels have in common.
struct Compared {
  double lightness = 0;  ///< largest difference of L*, of pixels that are not transparent
  double alpha = 0;      ///< of coverage
  double chroma = 0;     ///< mean of the second
};

Compared compared(const fs::path& grey_file, const fs::path& color_file) {
  cv::Mat grey = cv::imread(grey_file.string(), cv::IMREAD_UNCHANGED);
  cv::Mat color = cv::imread(color_file.string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(grey.size(), color.size());
  EXPECT_EQ(color.type(), CV_16UC4) << "the sample's pictures have alpha";
  grey.convertTo(grey, CV_64F, grey.depth() == CV_8U ? 1 / 255.0 : 1 / 65535.0);
  color.convertTo(color, CV_64F, 1 / 65535.0);
  Compared most;
  int pixels = 0;
  for (int i = 0; i < int(grey.total()); ++i) {
    const auto& before = grey.at<cv::Vec4d>(i / grey.cols, i % grey.cols);
    const auto& after = color.at<cv::Vec4d>(i / grey.cols, i % grey.cols);
    most.alpha = std::max(most.alpha, std::abs(before[3] - after[3]));
    if (before[3] == 0) continue;
    const auto lab = [](const cv::Vec4d& bgr) {
      return lab_from_linear_rgb<double>(
          {linear_from_srgb(bgr[2]), linear_from_srgb(bgr[1]), linear_from_srgb(bgr[0])});
    };
    most.lightness = std::max(most.lightness, std::abs(lab(before).lightness - lab(after).lightness));
    most.chroma += std::hypot(lab(after).a, lab(after).b);
    ++pixels;
  }
  most.chroma /= pixels;
  return most;
}

TEST_F(Photographs, HaveTheirOwnLightnessAndCoverageInEveryPixel) {
  const std::vector<fs::path> files = written({"vivid", {}, out_ / "photographs"});
  ASSERT_EQ(files.size(), 6u) << "held-out ones too";
  double worst = 0;
  for (const fs::path& file : files) {
    const Compared pictures = compared(capture() / "images" / file.filename(), file);
    worst = std::max(worst, pictures.lightness);
    EXPECT_LT(pictures.alpha, 1e-6) << file;
    EXPECT_GT(pictures.chroma, 5) << file;
  }
  EXPECT_EQ(cv::imread((out_ / "photographs/view_003.png").string()).cols, 960) << "full size, not the trained one";
  // Half a code of 8 bits is 0.14 of L* and more. Measured 0.00098 at most.
  EXPECT_LT(worst, 0.01);
  RecordProperty("largest difference of L*", std::to_string(worst));
}

TEST_F(Photographs, OfSomeViewsAndAsTiff) {
  const std::vector<fs::path> files =
      written({"vivid", {"view_002", "images/view_001.png"}, out_ / "t", PhotographFormat::kTiff});
  EXPECT_THAT(files, testing::ElementsAre(out_ / "t/view_001.tiff", out_ / "t/view_002.tiff"));
  const std::vector<fs::path> again = written({"vivid", {"view_001.png"}, out_ / "p"});
  const cv::Mat tiff = cv::imread(files[0].string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(cv::norm(tiff, cv::imread(again.at(0).string(), cv::IMREAD_UNCHANGED), cv::NORM_INF), 0);
}

TEST_F(Photographs, OfTheSameNameGetThatOfTheirView) {
  const fs::path moved = out_ / "capture";
  fs::copy(capture(), moved, fs::copy_options::recursive);
  fs::create_directories(moved / "images/b");
  fs::rename(moved / "images/view_002.png", moved / "images/b/view_001.png");
  std::string poses = read_text_file(moved / "transforms.json");
  for (std::size_t at; (at = poses.find("images/view_002")) != std::string::npos;) {
    poses.replace(at, 15, "images/b/view_001");
  }
  write_file(moved / "transforms.json", poses);
  const PhotographsJob job{"vivid", {"images/view_001.png", "images/b/view_001.png"}, out_ / "p", {}, moved};
  const std::vector<fs::path> files = photographs_step(run(moved), job, cpu_engines(), silent());
  EXPECT_THAT(files, testing::UnorderedElementsAre(out_ / "p/images_view_001.png", out_ / "p/images_b_view_001.png"));

  PhotographsJob unclear = job;
  unclear.views = {"view_001"};
  EXPECT_THAT([&] { (void)photographs_step(run(moved), unclear, cpu_engines(), silent()); },
              ThrowsMessage<UsageError>(HasSubstr("2 views of the capture are called view_001")));
  EXPECT_THAT([&] { (void)written(job); }, ThrowsMessage<InputError>(HasSubstr("other ones")))
      << "of another capture than the context's";
}

TEST_F(Photographs, StandUprightWhereTheCaptureHoldsThemAsTheyAreStored) {
  const fs::path changed = out_ / "capture";
  fs::copy(capture(), changed, fs::copy_options::recursive);
  const RunContext context = run(changed);
  cv::Mat3b stored(72, 96, cv::Vec3b(40, 40, 40));
  stored.colRange(0, 48).setTo(cv::Scalar(200, 200, 200));  // bright on the left
  write_file(changed / "images/view_001.png", test::jpeg_with(test::exif_block(6), stored));
  const PhotographsJob job{"vivid", {"view_001"}, out_ / "p", {}, changed};
  const std::vector<fs::path> files = photographs_step(context, job, cpu_engines(), silent());
  const cv::Mat written = cv::imread(files.at(0).string(), cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH);
  ASSERT_EQ(written.size(), cv::Size(72, 96));
  const double top = cv::mean(written.rowRange(0, 40))[0], bottom = cv::mean(written.rowRange(56, 96))[0];
  EXPECT_GT(top, 2 * bottom) << "orientation 6: the left of what is stored is the top";
}

/// Cancels once one photograph is written.
class Impatient final : public Observer {
 public:
  void report_progress(const Progress& progress) override { fractions.push_back(progress.fraction); }
  [[nodiscard]] bool is_cancelled() const override { return !fractions.empty(); }
  std::vector<double> fractions;
};

TEST_F(Photographs, ACancelledStepLeavesWholeOnes) {
  Impatient observer;
  const PhotographsJob job{"vivid", {"view_000", "view_001", "view_002"}, out_ / "p"};
  EXPECT_THAT([&] { (void)written(job, observer); }, ThrowsMessage<Interrupted>(HasSubstr("1 of 3")));
  EXPECT_EQ(observer.fractions, std::vector<double>{1.0 / 3});
  EXPECT_FALSE(cv::imread((out_ / "p/view_000.png").string()).empty());
  EXPECT_FALSE(fs::exists(out_ / "p/view_001.png"));
}

TEST_F(Photographs, AreRefusedByName) {
  const auto refused = [&](const PhotographsJob& job) {
    try {
      (void)written(job);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("not refused");
  };
  EXPECT_THAT(refused({"", {}, out_ / "p"}), HasSubstr("has no take yet"));
  EXPECT_THAT(refused({"zebra", {}, out_ / "p"}), HasSubstr("zebra"));
  EXPECT_THAT(refused({"vivid", {"view_099"}, out_ / "p"}), HasSubstr("no views of the capture are called view_099"));
  EXPECT_FALSE(fs::exists(out_ / "p"));
  EXPECT_THAT([] { (void)photograph_format_named("jpg"); }, ThrowsMessage<UsageError>(HasSubstr("png or tiff")));
}

TEST_F(Photographs, OfAnotherShapeThanTheViewAreRefused) {
  const fs::path changed = out_ / "capture";
  fs::copy(capture(), changed, fs::copy_options::recursive);
  const RunContext context = run(changed);
  cv::imwrite((changed / "images/view_001.png").string(), cv::Mat(70, 20, CV_8UC1, cv::Scalar(9)));
  const PhotographsJob job{"vivid", {"view_001"}, out_ / "p", {}, changed};
  EXPECT_THAT([&] { (void)photographs_step(context, job, cpu_engines(), silent()); },
              ThrowsMessage<InputError>(HasSubstr("view_001.png: size")));
}

}  // namespace
}  // namespace cnerf::pipeline
