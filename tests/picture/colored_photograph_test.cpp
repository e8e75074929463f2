#include "src/picture/colored_photograph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>

#include "src/base/files.h"
#include "src/base/rng.h"
#include "src/color/colorspace_math.h"
#include "src/picture/encode.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

Lab<double> lab_of(const std::uint16_t* bgr) {
  const auto linear = [](std::uint16_t code) { return linear_from_srgb(code / 65535.0); };
  return lab_from_linear_rgb<double>({linear(bgr[2]), linear(bgr[1]), linear(bgr[0])});
}

/// Grey of every lightness, and chroma far beyond sRGB in all directions.
struct Vivid {
  GreyPhotograph photograph{80, 60, {}, {}};
  ChromaSamples chroma{10, 8, {}, {}, {}};

  Vivid() {
    const CounterRng rng(5, 1);
    for (std::uint64_t i = 0; i < 80 * 60; ++i) photograph.luminance.push_back(std::pow(rng.uniform(i), 3.0f));
    for (std::uint64_t i = 0; i < 80; ++i) {
      const float angle = 6.2832f * rng.uniform(10000 + i);
      chroma.ab.push_back({120 * std::cos(angle), 120 * std::sin(angle)});
      chroma.lightness.push_back(50);
      chroma.weight.push_back(1);
    }
  }
};

TEST(ColoredPhotograph, KeepsLightnessAndReducesChromaAlone) {
  const Vivid vivid;
  const cv::Mat picture = colored_photograph(vivid.photograph, vivid.chroma);
  ASSERT_EQ(picture.type(), CV_16UC3);
  const JointUpsampler upsampler(vivid.chroma, 80, 60);
  double worst_lightness = 0, worst_hue = 0;
  int reduced = 0;
  for (int i = 0; i < 80 * 60; ++i) {
    const Lab<double> lab = lab_of(picture.ptr<std::uint16_t>(i / 80) + std::ptrdiff_t(3) * (i % 80));
    const double lightness = lightness_from_luminance<double>(vivid.photograph.luminance[std::size_t(i)]);
    const Ab wanted = upsampler.at(i % 80, i / 80, float(lightness));
    worst_lightness = std::max(worst_lightness, std::abs(lab.lightness - lightness));
    const double size = std::hypot(wanted.a, wanted.b), chroma = std::hypot(lab.a, lab.b);
    EXPECT_LT(chroma, size + 0.1);
    if (chroma < size - 1) ++reduced;
    worst_hue = std::max(worst_hue, std::abs(lab.a * wanted.b - lab.b * wanted.a) / size);
  }
  EXPECT_GT(reduced, 1000) << "the samples are to lie beyond sRGB";
  EXPECT_LT(worst_lightness, 0.005) << "L*; half a code of 16 bits near black is 0.0005, of three channels more";
  EXPECT_LT(worst_hue, 0.1) << "ab across the wanted direction: codes of 16 bits near black";
}

TEST(ColoredPhotograph, WithoutChromaIsItsGreyToTheCode) {
  Vivid vivid;
  for (Ab& ab : vivid.chroma.ab) ab = {};
  const cv::Mat picture = colored_photograph(vivid.photograph, vivid.chroma);
  for (int i = 0; i < 80 * 60; ++i) {
    const auto* pixel = picture.ptr<std::uint16_t>(i / 80) + std::ptrdiff_t(3) * (i % 80);
    const double code = 65535 * srgb_from_linear<double>(vivid.photograph.luminance[std::size_t(i)]);
    EXPECT_NEAR(pixel[0], code, 0.6);
    EXPECT_EQ(pixel[0], pixel[1]);
    EXPECT_EQ(pixel[1], pixel[2]);
  }
}

TEST(ColoredPhotograph, CoverageStaysAndLightBeyondWhiteIsWhite) {
  Vivid vivid;
  vivid.photograph.alpha.assign(80 * 60, 1.0f);
  vivid.photograph.alpha[1] = 0.25f;
  vivid.photograph.luminance[0] = 7;
  const cv::Mat picture = colored_photograph(vivid.photograph, vivid.chroma);
  ASSERT_EQ(picture.type(), CV_16UC4);
  const auto* pixel = picture.ptr<std::uint16_t>(0);
  for (int c = 0; c < 4; ++c) EXPECT_EQ(pixel[c], 65535);
  EXPECT_EQ(pixel[7], 16384);
}

TEST(ColoredPhotograph, BothFilesHoldItAndPngSaysSrgb) {
  const test::TempDir folder;
  const Vivid vivid;
  for (const bool with_alpha : {false, true}) {
    GreyPhotograph photograph = vivid.photograph;
    if (with_alpha) photograph.alpha.assign(80 * 60, 0.5f);
    const cv::Mat picture = colored_photograph(photograph, vivid.chroma);
    write_srgb_png(folder / "a.png", picture);
    write_tiff(folder / "a.tiff", picture);
    for (const char* name : {"a.png", "a.tiff"}) {
      const cv::Mat read = cv::imread((folder / name).string(), cv::IMREAD_UNCHANGED);
      ASSERT_EQ(read.type(), picture.type()) << name;
      EXPECT_EQ(cv::norm(read, picture, cv::NORM_INF), 0) << name;
    }
    const std::vector<std::byte> bytes = read_binary_file(folder / "a.png");
    const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    EXPECT_EQ(text.find("sRGB"), 8u + 25 + 4) << "right behind the header, before the pixels";
  }
}

}  // namespace
}  // namespace cnerf
