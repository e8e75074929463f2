#include "src/pipeline/prepare_step.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/observer.h"
#include "src/color/colorspace_math.h"
#include "src/engine/engines.h"
#include "src/sample/sample_scene.h"
#include "tests/support/data.h"
#include "tests/support/json_file.h"
#include "tests/support/no_programs.h"

namespace cnerf::pipeline {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// A capture as preparing leaves it, without its work/, which its owner may delete.
class PreparedCapture : public testing::Test {
 protected:
  PreparedCapture() {
    fs::create_directories(photos_);
    write_file(capture_ / "transforms.json", std::string_view("{}"));
    write_file(capture_ / "prepare.json", "{\"source\": \"" + photos_.string() + "\"}");
    write_file(capture_ / "images/a.png", std::string_view("picture"));
  }
  void prepare(const fs::path& source, const ExistingOutput& existing, const PrepareStepOptions& options = {}) {
    Observer silent;
    prepare_step({source, capture_, options, existing}, cpu_engines(), silent);
  }
  /// What going on says.
  std::string notes_of() {
    class Notes final : public Observer {
     public:
      void say(const std::string& line) override { text += line + "\n"; }
      std::string text;
    } notes;
    prepare_step({photos_, capture_, {}, {.resume = true}}, cpu_engines(), notes);
    return notes.text;
  }

  test::TempDir folder_;
  fs::path photos_ = folder_ / "photos", capture_ = folder_ / "capture";
};

TEST_F(PreparedCapture, IsGoneOnWithWithoutItsWork) {
  prepare(photos_, {.resume = true});
  EXPECT_TRUE(fs::exists(capture_ / "images/a.png"));
}

TEST_F(PreparedCapture, OfOtherPhotographsIsRefused) {
  fs::create_directories(folder_ / "others");
  EXPECT_TRUE(was_begun_for_another({folder_ / "others", capture_, {}, {}}));
  EXPECT_THAT([&] { prepare(folder_ / "others", {.resume = true}); },
              ThrowsMessage<UsageError>(HasSubstr("another source, " + photos_.string())));
}

TEST_F(PreparedCapture, SaysWherePhotographsCameSince) {
  write_file(photos_ / "a.jpg", std::string_view("picture"));
  const auto now = fs::last_write_time(photos_ / "a.jpg");
  const auto is_told = [&](int seconds_of_photograph, int seconds_of_folder) {
    fs::last_write_time(capture_ / "transforms.json", now);
    fs::last_write_time(photos_ / "a.jpg", now + std::chrono::seconds(seconds_of_photograph));
    fs::last_write_time(photos_, now + std::chrono::seconds(seconds_of_folder));
    return testing::Value(notes_of(), HasSubstr("has changed since; cnerf prepare"));
  };
  EXPECT_FALSE(is_told(-1, -1));
  EXPECT_TRUE(is_told(1, -1)) << "written again";
  EXPECT_TRUE(is_told(-1, 1)) << "came or went";
  fs::create_directories(photos_ / "images");
  fs::last_write_time(photos_ / "images", now + std::chrono::seconds(1));
  EXPECT_TRUE(is_told(-1, -1)) << "in images/";
}

TEST_F(PreparedCapture, IsMadeAgainIfAsked) {
  EXPECT_THAT([&] { prepare(photos_, {}); }, ThrowsMessage<UsageError>(HasSubstr("--overwrite")));
  EXPECT_THROW(prepare(photos_, {.overwrite = true}), Error) << "there are no photographs";
  EXPECT_FALSE(fs::exists(capture_ / "images/a.png"));
}

TEST_F(PreparedCapture, StaysWhereGoingOnAndOverwritingAreAskedAtOnce) {
  EXPECT_THAT([&] { prepare(photos_, {.resume = true, .overwrite = true}); },
              ThrowsMessage<UsageError>(HasSubstr("give one of them")));
  EXPECT_TRUE(fs::exists(capture_ / "images/a.png"));
}

TEST_F(PreparedCapture, IsNotClearedOfWhatItIsMadeOf) {
  write_file(capture_ / "masks/a.png", std::string_view("mask"));
  write_file(capture_ / "work/sparse/0/images.bin", std::string_view("model"));
  const auto refused = [&](const fs::path& source, const fs::path& masks, const fs::path& model) {
    PrepareStepOptions options;
    options.capture.masks = masks.string();
    options.capture.colmap_model = model.string();
    EXPECT_THAT([&] { prepare(source, {.overwrite = true}, options); },
                ThrowsMessage<UsageError>(HasSubstr("--overwrite would remove it")));
  };
  refused(photos_, capture_ / "masks", {});
  refused(photos_, {}, capture_ / "work/sparse/0");
  refused(capture_ / "images", {}, {});
  refused(capture_, {}, {});  // of which images/ would be read
  for (const char* file : {"images/a.png", "masks/a.png", "work/sparse/0/images.bin", "transforms.json"}) {
    EXPECT_TRUE(fs::exists(capture_ / file)) << file;
  }
}

TEST_F(PreparedCapture, IsNotClearedForOptionsThatCannotBeMeant) {
  PrepareStepOptions haze, measure, levels;
  levels.capture.sensor.black_level = 200;
  levels.capture.sensor.white_level = 100;
  haze.capture.haze = haze.capture.no_exposure = true;
  measure.capture.frame.measure = "10,10,a 20,20,b = .m";
  EXPECT_THAT([&] { prepare(photos_, {.overwrite = true}, haze); },
              ThrowsMessage<UsageError>(HasSubstr("haze, no_exposure")));
  EXPECT_THAT([&] { prepare(photos_, {.overwrite = true}, measure); }, ThrowsMessage<UsageError>(HasSubstr("measure")));
  EXPECT_THAT([&] { prepare(photos_, {.overwrite = true}, levels); },
              ThrowsMessage<UsageError>(HasSubstr("black_level")));
  EXPECT_TRUE(fs::exists(capture_ / "images/a.png"));
}

TEST_F(PreparedCapture, OfAnotherTransferIsRefused) {
  PrepareStepOptions options;
  options.capture.sensor.transfer = "linear";
  EXPECT_THAT([&] { prepare(photos_, {.resume = true}, options); },
              ThrowsMessage<UsageError>(HasSubstr("another transfer")));
  write_file(capture_ / "prepare.json",
             "{\"source\": \"" + photos_.string() + "\", \"transfer\": {\"source\": \"linear\"}}");
  EXPECT_NO_THROW(prepare(photos_, {.resume = true}, options));
}

/// One file names the masks, another says that motion was looked for; a stop between them must not lose the masks.
TEST_F(PreparedCapture, IsLookedAtForMotionUntilTheMasksAreNamed) {
  write_sample_scene(capture_, {.views = 8, .width = 48, .height = 36, .samples_per_pixel = 1});
  PrepareStepOptions options;
  options.motion_masks = true;
  options.motion.motion_steps = 50;
  // In the place of the temporary file that transforms.json would be made of.
  const fs::path obstacle = capture_ / (".transforms.partial-" + std::to_string(::getpid()) + ".json");
  fs::create_directories(obstacle);
  EXPECT_THAT([&] { prepare(photos_, {.resume = true}, options); },
              ThrowsMessage<OutputError>(HasSubstr("transforms.json")));
  EXPECT_FALSE(test::json_of(capture_ / "prepare.json").contains("motion"));
  fs::remove(obstacle);
  prepare(photos_, {.resume = true}, options);
  EXPECT_TRUE(test::json_of(capture_ / "prepare.json").contains("motion"));
}

TEST_F(PreparedCapture, IsNotTakenForOneWhereTheRecordNamesNoSource) {
  write_file(capture_ / "prepare.json", std::string_view("{\"source\": 3}"));
  EXPECT_THAT([&] { prepare(photos_, {.overwrite = true}); },
              ThrowsMessage<UsageError>(HasSubstr("holds no prepared capture")));
  EXPECT_TRUE(fs::exists(capture_ / "images/a.png"));
}

TEST(CaptureOf, PhotographsIsReadWithTheTransferOfTheRun) {
  const test::TempDir folder;
  fs::create_directories(folder / "photos");
  for (const char* name : {"photos/a.png", "photos/b.png"}) {
    ASSERT_TRUE(cv::imwrite((folder / name).string(), cv::Mat1b(40, 60, std::uint8_t(99))));
  }
  const test::NoPrograms none;
  Observer silent;
  EXPECT_THROW((void)capture_of(folder / "photos", folder / "run", "linear", silent), DeviceError) << "no COLMAP";
  const cv::Mat image = cv::imread((folder / "run-capture/images/a.png").string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(image.type(), CV_16UC1);
  EXPECT_NEAR(linear_from_srgb(image.at<std::uint16_t>(0) / 65535.0), 99 / 255.0, 1e-4);
}

}  // namespace
}  // namespace cnerf::pipeline
