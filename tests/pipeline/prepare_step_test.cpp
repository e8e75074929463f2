#include "src/pipeline/prepare_step.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/observer.h"
#include "src/engine/engines.h"
#include "tests/support/data.h"

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
  void prepare(const fs::path& source, const ExistingOutput& existing) {
    Observer silent;
    prepare_step({source, capture_, {}, existing}, cpu_engines(), silent);
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

TEST_F(PreparedCapture, IsNotTakenForOneWhereTheRecordNamesNoSource) {
  write_file(capture_ / "prepare.json", std::string_view("{\"source\": 3}"));
  EXPECT_THAT([&] { prepare(photos_, {.overwrite = true}); },
              ThrowsMessage<UsageError>(HasSubstr("holds no prepared capture")));
  EXPECT_TRUE(fs::exists(capture_ / "images/a.png"));
}

}  // namespace
}  // namespace cnerf::pipeline
