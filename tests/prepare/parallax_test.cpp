#include "src/prepare/parallax.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/support/data.h"

namespace cnerf::prepare {
namespace {
namespace fs = std::filesystem;

/// Writes pictures as the images of a capture.
std::vector<PreparedImage> images_in(const fs::path& capture, const std::vector<cv::Mat1b>& pictures) {
  std::vector<PreparedImage> images;
  fs::create_directories(capture / "images");
  for (const cv::Mat1b& picture : pictures) {
    PreparedImage image;
    image.name = "p" + std::to_string(100 + images.size()) + ".png";
    image.width = picture.cols;
    image.height = picture.rows;
    cv::imwrite((capture / "images" / image.name).string(), picture);
    images.push_back(std::move(image));
  }
  return images;
}

cv::Mat1b photograph(const fs::path& file, double scale) {
  cv::Mat picture = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
  cv::resize(picture, picture, {}, scale, scale, cv::INTER_AREA);
  return picture;
}

/// What a camera shows that turns and zooms on the spot where `scene` was taken: the part of it that it sees.
cv::Mat1b turned(const cv::Mat1b& scene, double focal, double pan, double tilt, double zoom) {
  const cv::Size out(720, 960);
  const cv::Matx33d source(focal, 0, scene.cols / 2.0, 0, focal, scene.rows / 2.0, 0, 0, 1);
  const cv::Matx33d camera(zoom * focal, 0, out.width / 2.0, 0, zoom * focal, out.height / 2.0, 0, 0, 1);
  const double c = std::cos(pan), s = std::sin(pan), d = std::cos(tilt), t = std::sin(tilt);
  const cv::Matx33d turn = cv::Matx33d(1, 0, 0, 0, d, -t, 0, t, d) * cv::Matx33d(c, 0, s, 0, 1, 0, -s, 0, c);
  cv::Mat1b picture;
  cv::warpPerspective(scene, picture, camera * turn * source.inv(), out, cv::INTER_AREA, cv::BORDER_REFLECT);
  return picture;
}

TEST(Parallax, PhotographsTakenFromOnePlaceAreToldWhateverTheirZoom) {
  CNERF_REQUIRE_DATA(fox, "scenes/fox");
  const cv::Mat1b scene = photograph(fox / "images" / "0001.jpg", 1);
  std::vector<cv::Mat1b> pictures;
  for (int i = 0; i < 9; ++i)
    pictures.push_back(turned(scene, 1375, 0.04 * (i - 4), 0.03 * ((i % 3) - 1), 1 + 0.02 * i));
  const test::TempDir folder;
  const ParallaxSurvey survey = survey_parallax(images_in(folder.path(), pictures), folder.path());
  EXPECT_GE(survey.judged, 8);
  EXPECT_TRUE(survey.only_turned()) << survey.with_parallax << " of " << survey.judged << " pairs show parallax";
}

class RealCaptures : public testing::TestWithParam<const char*> {};

TEST_P(RealCaptures, ShowParallax) {
  CNERF_REQUIRE_DATA(folder, GetParam());
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::ranges::sort(files);
  std::vector<cv::Mat1b> pictures;
  for (std::size_t i = 0; i < std::min<std::size_t>(files.size(), 16); ++i)
    pictures.push_back(photograph(files[i], 0.4));
  const test::TempDir capture;
  const ParallaxSurvey survey = survey_parallax(images_in(capture.path(), pictures), capture.path());
  EXPECT_GE(survey.judged, 4);
  EXPECT_FALSE(survey.only_turned()) << survey.with_parallax << " of " << survey.judged;
}
INSTANTIATE_TEST_SUITE_P(, RealCaptures, testing::Values("scenes/fox/images", "scenes/flower/images_4"));

TEST(Parallax, WithoutPairsThatTellNothingIsRefused) {
  cv::Mat1b grey(120, 160, std::uint8_t(90));
  const test::TempDir folder;
  const ParallaxSurvey survey = survey_parallax(images_in(folder.path(), {grey, grey, grey}), folder.path());
  EXPECT_EQ(survey.judged, 0);
  EXPECT_FALSE(survey.only_turned());
}

}  // namespace
}  // namespace cnerf::prepare
