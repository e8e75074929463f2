#include "src/picture/picture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/picture/encode.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

Picture red_and_blue() {
  return {2, 1, {200, 30, 10, 10, 30, 200}};
}

cv::Mat decoded(const std::vector<std::byte>& bytes) {
  return cv::imdecode(cv::Mat(1, int(bytes.size()), CV_8U, const_cast<std::byte*>(bytes.data())), cv::IMREAD_COLOR);
}

TEST(Picture, CodesAreRoundedAndClamped) {
  EXPECT_EQ(srgb8_from_linear(std::vector<float>{-1, 0, 0.318547f, 1, 9}),
            (std::vector<std::uint8_t>{0, 0, 153, 255, 255}));
  EXPECT_EQ(srgb8_from_linear(0.318547), 153);
}

TEST(Picture, CodesOfFloatsAreThoseOfTheCurve) {
  const auto agrees = [](float light) {
    const double encoded = 255 * srgb_from_linear(double(light));
    return std::abs(double(srgb8_from_linear(light)) - encoded) <= 0.5 + 1e-9;
  };
  for (int i = 0; i <= 1 << 20; ++i) ASSERT_TRUE(agrees(float(i) / float(1 << 20))) << i;
  for (int code = 1; code < 256; ++code) {  // and beside every border, where one float decides
    const auto border = float(linear_from_srgb((code - 0.5) / 255));
    for (float light = std::nextafter(border, 0.0f); light <= std::nextafter(border, 1.0f);
         light = std::nextafter(light, 1.0f)) {
      ASSERT_TRUE(agrees(light)) << code;
    }
  }
  EXPECT_EQ(srgb8_from_linear(std::nanf("")), 0);
}

TEST(Picture, GreyAndColourComeFromLinearLight) {
  EXPECT_EQ(picture_from_linear(1, 2, std::vector{1.0f, 0.0f}).rgb,
            (std::vector<std::uint8_t>{255, 255, 255, 0, 0, 0}));
  // 0.318547 is the linear light of sRGB 0.6, which is 153.
  EXPECT_EQ(picture_from_linear(1, 1, std::vector{0.318547f, 0.0f, 2.0f}).rgb,
            (std::vector<std::uint8_t>{153, 0, 255}));
}

TEST(Picture, PlanesOfLabBecomeInterleavedLight) {
  // L*a*b* of sRGB red (color check values of CIE 1976), and L* 50, which is sRGB 119.
  const std::vector<float> linear =
      linear_rgb_from_lab(std::vector{53.241f, 50.0f}, std::vector{80.094f, 0.0f, 67.203f, 0.0f});
  ASSERT_EQ(linear.size(), 6u);
  EXPECT_NEAR(linear[0], 1, 0.02);
  EXPECT_NEAR(linear[1], 0, 0.01);
  EXPECT_NEAR(linear[2], 0, 0.01);
  EXPECT_EQ(srgb8_from_linear(linear[4]), 119);
  EXPECT_EQ(linear_rgb_from_lab(std::vector{50.0f}, {})[2], linear[5]);
  EXPECT_THROW((void)linear_rgb_from_lab(std::vector{50.0f}, std::vector{1.0f}), ContractError);
}

TEST(Picture, ManyColorsOfLabAreThoseOfEach) {
  std::vector<float> lightness, a, b;
  for (int i = 0; i < 4099; ++i) {  // no multiple of what is converted at once
    lightness.push_back(float(i % 113) - 4);
    a.push_back(i == 7 ? 0 : float(i % 37) * 5 - 90);
    b.push_back(i == 7 ? 0 : float(i % 41) * 5 - 100);
  }
  for (const float gain : {1.0f, 0.25f}) {
    std::vector<std::uint8_t> many(3 * a.size()), grey(many.size());
    srgb8_from_lab(lightness, a, b, gain, many);
    srgb8_from_lab(lightness, {}, {}, gain, grey);
    for (std::size_t i = 0; i < a.size(); ++i) {
      const float l = std::max(lightness[i], 0.0f);
      const Vec3f one = gamut_mapped_linear_rgb_from_lab<float>({lightness[i], a[i], b[i]});
      const Vec3f wanted = linear_rgb_from_lab<float>({l, a[i], b[i]});
      const auto [least, most] = std::minmax({wanted.x, wanted.y, wanted.z});
      for (int c = 0; c < 3; ++c) {
        // Chroma that leaves the gamut is found less exactly than floats could have it.
        EXPECT_NEAR(many[3 * i + std::size_t(c)], srgb8_from_linear(gain * one[c]), least >= 0 && most <= 1 ? 0 : 1);
        EXPECT_EQ(grey[3 * i + std::size_t(c)], srgb8_from_linear(gain * luminance_from_lightness(l)));
      }
    }
    EXPECT_EQ(many[21], many[23]) << "no chroma";
  }
  EXPECT_THROW(srgb8_from_lab(lightness, a, b, 1, std::span<std::uint8_t>()), ContractError);
  std::vector<std::uint8_t> rgb(3 * a.size());
  EXPECT_THROW(srgb8_from_lab(lightness, a, std::span(b).first(9), 1, rgb), ContractError);
}

TEST(Encode, KeepsTheOrderOfChannels) {
  for (const auto& bytes : {png_bytes(red_and_blue()), png_bytes(red_and_blue(), PngEffort::kBytes)}) {
    EXPECT_EQ(decoded(bytes).at<cv::Vec3b>(0, 0), cv::Vec3b(10, 30, 200));
  }
  EXPECT_GT(decoded(jpeg_bytes(Picture{1, 1, {220, 20, 20}}, 95)).at<cv::Vec3b>(0, 0)[2], 150);
}

TEST(Encode, WritesAPngOrNothing) {
  const test::TempDir folder;
  write_png(folder / "picture.png", red_and_blue());
  EXPECT_EQ(decoded(read_binary_file(folder / "picture.png")).at<cv::Vec3b>(0, 1), cv::Vec3b(200, 30, 10));
  write_file(folder / "a-file", std::string_view("x"));
  EXPECT_THROW(write_png(folder / "a-file" / "picture.png", red_and_blue()), OutputError);
}

TEST(Encode, ErrorsNameTheFileAndTheSize) {
  const test::TempDir folder;
  try {
    write_png(folder / "none.png", cv::Mat());
    FAIL() << "a picture without pixels was written";
  } catch (const OutputError& error) {
    EXPECT_NE(std::string(error.what()).find("none.png: a picture of 0 x 0 pixels"), std::string::npos) << error.what();
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "none.png"));
}

}  // namespace
}  // namespace cnerf
