#include "src/pipeline/prepare_step.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

TEST_F(PreparedCapture, IsMadeAgainIfAsked) {
  EXPECT_THAT([&] { prepare(photos_, {}); }, ThrowsMessage<UsageError>(HasSubstr("--overwrite")));
  EXPECT_THROW(prepare(photos_, {.overwrite = true}), Error) << "there are no photographs";
  EXPECT_FALSE(fs::exists(capture_ / "images/a.png"));
}

TEST_F(PreparedCapture, IsNotTakenForOneWhereTheRecordNamesNoSource) {
  write_file(capture_ / "prepare.json", std::string_view("{\"source\": 3}"));
  EXPECT_THAT([&] { prepare(photos_, {.overwrite = true}); },
              ThrowsMessage<UsageError>(HasSubstr("holds no prepared capture")));
  EXPECT_TRUE(fs::exists(capture_ / "images/a.png"));
}

}  // namespace
}  // namespace cnerf::pipeline
