#include "src/prepare/video.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/rng.h"
#include "src/base/vec3.h"
#include "tests/support/data.h"

namespace cnerf::prepare {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

const cv::Size kSize(320, 180);

/// Discs floating between depth 3 and 9: what a camera at (x, 0, 0), turned by `pan`, sees of them.
cv::Mat1b view_of_discs(double x, double pan, int seed = 1) {
  SequentialRng rng(std::uint64_t(seed), 0);
  struct Disc {
    Vec3d at;
    double radius;
    int code;
  };
  std::vector<Disc> discs;
  for (int i = 0; i < 160; ++i) {
    const double depth = 3 + 6.0 * rng.uniform();
    discs.push_back({{(rng.uniform() - 0.5) * 16, (rng.uniform() - 0.5) * depth * 0.6, depth},
                     0.06 + 0.14 * rng.uniform(),
                     20 + int(rng.below(220))});
  }
  std::ranges::sort(discs, [](const Disc& a, const Disc& b) { return a.at.z > b.at.z; });
  cv::Mat1b out(kSize, std::uint8_t(105));
  const double focal = 280, c = std::cos(pan), s = std::sin(pan);
  for (const Disc& disc : discs) {
    const Vec3d p = {c * (disc.at.x - x) - s * disc.at.z, disc.at.y, s * (disc.at.x - x) + c * disc.at.z};
    if (p.z < 0.3) continue;
    const cv::Point centre(int(16 * (focal * p.x / p.z + 160)), int(16 * (focal * p.y / p.z + 90)));
    cv::circle(out, centre, int(16 * focal * disc.radius / p.z), cv::Scalar(disc.code), cv::FILLED, cv::LINE_AA, 4);
  }
  return out;
}

/// A clip as a camera would leave it; skips the test where OpenCV cannot write one.
bool write_clip(const fs::path& file, const std::vector<cv::Mat1b>& frames) {
  cv::VideoWriter writer(file.string(), cv::VideoWriter::fourcc('m', 'p', '4', 'v'), 24, frames.front().size(), true);
  if (!writer.isOpened()) return false;
  for (const cv::Mat1b& frame : frames) {
    cv::Mat3b colored;
    cv::cvtColor(frame, colored, cv::COLOR_GRAY2BGR);
    writer.write(colored);
  }
  return true;
}

std::vector<cv::Mat1b> travelling(int frames, int seed = 1) {
  std::vector<cv::Mat1b> out;
  for (int i = 0; i < frames; ++i) out.push_back(view_of_discs(0.06 * i - 1, 0, seed));
  return out;
}

std::vector<cv::Mat1b> panning(int frames, int seed = 1) {
  std::vector<cv::Mat1b> out;
  for (int i = 0; i < frames; ++i) out.push_back(view_of_discs(0, 0.012 * i - 0.2, seed));
  return out;
}

void append(std::vector<cv::Mat1b>& to, const std::vector<cv::Mat1b>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

class Clip : public testing::Test {
 protected:
  ClipImport import_frames(const std::vector<cv::Mat1b>& frames, const VideoOptions& options = {},
                           const fs::path& masks = {}) {
    if (!write_clip(folder_ / "clip.mp4", frames)) throw MissingInputError("no MPEG-4 encoder");
    return import_clip(folder_ / "clip.mp4", folder_ / "out", masks, options, {}, {});
  }
  test::TempDir folder_;
};

TEST_F(Clip, ATravellingShotIsKept) {
  VideoOptions options;
  options.frames = 10;
  const ClipImport clip = import_frames(travelling(40), options);
  EXPECT_EQ(clip.report.frames, 40);
  ASSERT_EQ(clip.report.shots.size(), 1u);
  EXPECT_GT(clip.report.shots[0].parallax, 0.5);
  ASSERT_EQ(clip.set.images.size(), 10u);
  const cv::Mat first =
      cv::imread((folder_ / "out" / "images" / clip.set.images[0].name).string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(first.type(), CV_8UC1);
  EXPECT_EQ(first.size(), kSize);
  EXPECT_LT(cv::norm(first, travelling(40)[std::size_t(clip.set.images[0].frame)], cv::NORM_L1) / double(first.total()),
            6);
}

TEST_F(Clip, OneMaskServesAllFramesAndIsCutAsTheyAre) {
  std::vector<cv::Mat1b> frames = travelling(40);
  for (cv::Mat1b& frame : frames) cv::copyMakeBorder(frame, frame, 30, 30, 0, 0, cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::Mat1b logo(frames.front().size(), std::uint8_t(255));
  logo(cv::Rect(10, 35, 40, 20)) = 0;
  cv::imwrite((folder_ / "logo.png").string(), logo);
  VideoOptions options;
  options.frames = 6;
  const ClipImport clip = import_frames(frames, options, folder_ / "logo.png");
  ASSERT_EQ(clip.set.images.size(), 6u);
  for (const PreparedImage& image : clip.set.images) {
    const cv::Mat1b mask = cv::imread((folder_ / "out" / image.mask).string(), cv::IMREAD_GRAYSCALE);
    ASSERT_EQ(mask.size(), cv::Size(image.width, image.height));
    const cv::Rect cut = clip.report.picture;
    EXPECT_EQ(cv::norm(mask, logo(cut), cv::NORM_INF), 0);
    EXPECT_GT(cv::countNonZero(mask == 0), 700) << "the logo is hidden";
  }
}

TEST_F(Clip, MasksOfSingleFramesGoByTheirNames) {
  VideoOptions options;
  options.frames = 4;
  const std::string wanted = import_frames(travelling(40), options).set.images[1].name;
  fs::create_directories(folder_ / "masks");
  cv::Mat1b half(kSize, std::uint8_t(255));
  half.colRange(0, kSize.width / 2) = 0;
  cv::imwrite((folder_ / "masks" / wanted).string(), half);
  const ClipImport clip = import_frames(travelling(40), options, folder_ / "masks");
  EXPECT_TRUE(clip.set.images[0].mask.empty());
  EXPECT_EQ(clip.set.images[1].mask, fs::path("masks") / wanted);
  fs::rename(folder_ / "masks" / wanted, folder_ / "masks" / "other.png");
  EXPECT_THROW((void)import_frames(travelling(40), options, folder_ / "masks"), InputError);
  EXPECT_THROW((void)import_frames(travelling(40), options, folder_ / "absent"), MissingInputError);
  cv::imwrite((folder_ / "small.png").string(), cv::Mat1b(20, 20, std::uint8_t(255)));
  EXPECT_THROW((void)import_frames(travelling(40), options, folder_ / "small.png"), InputError);
}

TEST_F(Clip, APanIsRefusedWithTheReason) {
  try {
    (void)import_frames(panning(40));
    FAIL() << "not refused";
  } catch (const PosesError& error) {
    EXPECT_THAT(error.what(), HasSubstr("no parallax"));
    EXPECT_THAT(error.what(), HasSubstr("shot 1: frames 0 to 39"));
  }
  EXPECT_FALSE(fs::exists(folder_ / "out" / "images")) << "nothing is written for nothing";
  VideoOptions options;
  options.allow_no_parallax = true;
  EXPECT_GT(import_frames(panning(40), options).set.images.size(), 10u);
}

TEST_F(Clip, AStillCameraIsRefused) {
  try {
    (void)import_frames(std::vector<cv::Mat1b>(30, view_of_discs(0, 0)));
    FAIL() << "not refused";
  } catch (const PosesError& error) {
    EXPECT_THAT(error.what(), HasSubstr("hardly moves"));
  }
}

TEST_F(Clip, OfSeveralShotsTheTravellingOneIsTaken) {
  std::vector<cv::Mat1b> frames = panning(50, 2);
  append(frames, travelling(40, 3));
  const ClipImport clip = import_frames(frames);
  ASSERT_EQ(clip.report.shots.size(), 2u);
  EXPECT_EQ(clip.report.shots[0].range.end, 50);
  EXPECT_EQ(clip.report.shot, 2);
  EXPECT_GE(clip.report.kept.front(), 50);
  EXPECT_THAT(shot_lines(clip.report)[0], HasSubstr("no parallax"));
  VideoOptions options;
  options.shot = 1;
  EXPECT_THROW((void)import_frames(frames, options), PosesError);
  options.shot = 3;
  EXPECT_THROW((void)import_frames(frames, options), UsageError);
}

TEST_F(Clip, LetterboxIsCroppedAndTheOpticalAxisStays) {
  std::vector<cv::Mat1b> frames;
  for (const cv::Mat1b& frame : travelling(40)) {
    cv::Mat1b boxed(240, 320, std::uint8_t(0));
    frame.copyTo(boxed.rowRange(20, 200));  // not in the middle
    frames.push_back(boxed);
  }
  const ClipImport clip = import_frames(frames);
  const PreparedImage& image = clip.set.images.front();
  EXPECT_NEAR(image.height, 176, 2);
  EXPECT_EQ(image.width, 320);
  EXPECT_NEAR(image.centre_y, 120 - clip.report.picture.y, 1e-9)
      << "the axis goes through the middle of the stored frame";
}

TEST_F(Clip, RepeatedFramesAreNotKept) {
  std::vector<cv::Mat1b> frames;
  for (int i = 0; i < 40; ++i) {
    frames.push_back(view_of_discs(0.06 * i - 1, 0));
    if (i % 5 == 4) frames.push_back(frames.back());
  }
  VideoOptions options;
  options.frames = 48;
  const ClipImport clip = import_frames(frames, options);
  EXPECT_EQ(clip.report.shots[0].duplicates, 8);
  EXPECT_EQ(clip.set.images.size(), 40u);
}

TEST_F(Clip, FlickerAndGrainDoNotHideParallax) {
  SequentialRng rng(5, 0);
  std::vector<cv::Mat1b> frames = travelling(40);
  for (cv::Mat1b& frame : frames) {
    const double gain = 0.85 + 0.3 * rng.uniform();
    for (std::uint8_t& code : frame) code = cv::saturate_cast<std::uint8_t>(gain * code + 4 * rng.normal());
  }
  const ClipImport clip = import_frames(frames);
  EXPECT_GT(clip.report.shots.at(0).parallax, 0.5);
}

TEST_F(Clip, WovenFieldsAreTakenApart) {
  const std::vector<cv::Mat1b> moments = travelling(80);
  std::vector<cv::Mat1b> frames;
  for (std::size_t i = 0; i + 1 < moments.size(); i += 2) {
    cv::Mat1b woven = moments[i].clone();
    for (int y = 1; y < woven.rows; y += 2) moments[i + 1].row(y).copyTo(woven.row(y));
    frames.push_back(woven);
  }
  const ClipImport clip = import_frames(frames);
  EXPECT_TRUE(clip.report.interlaced);
  EXPECT_EQ(clip.set.images.front().height, 90);
  EXPECT_DOUBLE_EQ(clip.set.images.front().pixel_aspect, 0.5);
}

TEST_F(Clip, LevelsThatItsCodesCannotHaveAreRefused) {
  if (!write_clip(folder_ / "clip.mp4", travelling(10))) throw MissingInputError("no MPEG-4 encoder");
  for (const SensorOptions& sensor : {SensorOptions{"linear", 64, 1023}, SensorOptions{"linear", 200, 100}}) {
    EXPECT_THROW((void)import_clip(folder_ / "clip.mp4", folder_ / "out", {}, {}, sensor, {}), UsageError);
  }
}

TEST_F(Clip, OtherFilesAreRefused) {
  write_file(folder_ / "clip.mp4", std::string_view("no clip"));
  EXPECT_FALSE(is_clip(folder_ / "clip.mp4"));
  EXPECT_THROW((void)import_clip(folder_ / "clip.mp4", folder_ / "out", {}, {}, {}, {}), InputError);
}

}  // namespace
}  // namespace cnerf::prepare
