#include "src/capture/image_io.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/color/colorspace_math.h"
#include "src/picture/exr_writer.h"
#include "tests/capture/fixtures.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;

class ImageIo : public testing::Test {
 protected:
  test::TempDir folder_;

  fs::path write(const std::string& name, const cv::Mat& image) {
    cv::imwrite(folder_ / name, image);
    return folder_ / name;
  }
  static MonoImage read_mono(const fs::path& file, Transfer transfer = Transfer::kSrgb) {
    return encode_mono(luminance_image(read_linear_image(file, transfer)), transfer);
  }
};

/// Every code of a depth, in a square.
template <typename T>
cv::Mat all_codes(int type, int side) {
  cv::Mat image(side, side, type);
  for (int i = 0; i < side * side; ++i) {
    for (int c = 0; c < image.channels(); ++c) image.ptr<T>()[i * image.channels() + c] = T(i);
  }
  return image;
}

TEST_F(ImageIo, GreyBytesSurviveUnchanged) {
  for (const Transfer transfer : {Transfer::kSrgb, Transfer::kLinear, Transfer::kGamma22}) {
    const MonoImage image = read_mono(write("a.png", all_codes<std::uint8_t>(CV_8UC1, 16)), transfer);
    ASSERT_EQ(image.depth, PixelDepth::kU8);
    ASSERT_EQ(image.u8.size(), 256u);
    for (std::size_t i = 0; i < 256; ++i) ASSERT_EQ(image.u8[i], i);
  }
}

TEST_F(ImageIo, BytesOfLightAreRoundedCodes) {
  LinearImage image{1000, 60, 1, PixelDepth::kU8, {}, {}};  // -0.01 to 1.1
  for (std::size_t i = 0; i < image.pixel_count(); ++i) {
    image.values.push_back(float(double(i % 1000) - 10) * std::pow(10.0f, -float(i / 1000) / 10) / 900);
  }
  const std::vector<float> spread = image.values;
  for (const Transfer transfer : {Transfer::kSrgb, Transfer::kLinear, Transfer::kGamma22}) {
    image.values = spread;
    for (std::size_t code = 1; code < 256; ++code) {  // around where the code begins, float by float
      float light = decode_transfer(transfer, (float(code) - 0.5f) / 255.0f);
      for (int i = 0; i < 8; ++i) light = std::nextafter(light, 0.0f);
      for (std::size_t i = 0; i < 17; ++i, light = std::nextafter(light, 2.0f)) image.values[17 * code + i] = light;
    }
    const MonoImage mono = encode_mono(image, transfer);
    for (std::size_t i = 0; i < image.pixel_count(); ++i) {
      const float code = encode_transfer(transfer, std::clamp(image.values[i], 0.0f, 1.0f));
      ASSERT_EQ(mono.u8[i], std::lround(code * 255.0f)) << image.values[i];
    }
  }
}

TEST_F(ImageIo, SixteenBitsSurviveUnchanged) {
  for (const char* name : {"a.png", "a.tif"}) {
    const MonoImage image = read_mono(write(name, all_codes<std::uint16_t>(CV_16UC1, 256)));
    ASSERT_EQ(image.depth, PixelDepth::kU16) << name;
    for (std::size_t i = 0; i < 65536; ++i) ASSERT_EQ(image.u16[i], i) << name;
    EXPECT_TRUE(image.u8.empty());
  }
}

TEST_F(ImageIo, GreyStoredAsColourKeepsItsValues) {
  const MonoImage image = read_mono(write("a.png", all_codes<std::uint8_t>(CV_8UC3, 16)));
  for (std::size_t i = 0; i < 256; ++i) ASSERT_EQ(image.u8[i], i);
}

TEST_F(ImageIo, ColourBecomesRec709Luminance) {
  const fs::path file = write("a.png", cv::Mat(2, 3, CV_8UC3, cv::Scalar(30, 200, 90)));  // B G R
  const LinearImage linear = read_linear_image(file, Transfer::kSrgb);
  EXPECT_FALSE(is_monochrome(linear));
  const double expected = 0.2126729 * linear_from_srgb(90 / 255.0) + 0.7151522 * linear_from_srgb(200 / 255.0) +
                          0.0721750 * linear_from_srgb(30 / 255.0);
  const MonoImage image = read_mono(file);
  EXPECT_EQ(image.width, 3);
  EXPECT_EQ(image.height, 2);
  EXPECT_EQ(image.u8[0], std::lround(255 * srgb_from_linear(expected)));
  EXPECT_NEAR(image.luminance(0), expected, 0.005);
}

TEST_F(ImageIo, AlphaIsCompositedOverBlackInLinearLight) {
  const fs::path file = write("a.png", cv::Mat(1, 1, CV_8UC4, cv::Scalar(180, 180, 180, 64)));
  const MonoImage image = read_mono(file);
  ASSERT_EQ(image.alpha.size(), 1u);
  EXPECT_EQ(image.alpha[0], 64);
  EXPECT_NEAR(image.luminance(0), linear_from_srgb(180 / 255.0) * 64 / 255, 0.002);
  EXPECT_NEAR(image.coverage(0), 64 / 255.0, 1e-6);
}

TEST_F(ImageIo, OpaqueAlphaIsDropped) {
  EXPECT_TRUE(read_mono(write("a.png", cv::Mat(4, 4, CV_8UC4, cv::Scalar(9, 9, 9, 255)))).alpha.empty());
}

TEST_F(ImageIo, LuminanceDecodesTheTransfer) {
  const fs::path file = write("a.png", cv::Mat(1, 1, CV_8UC1, cv::Scalar(128)));
  EXPECT_NEAR(read_mono(file, Transfer::kSrgb).luminance(0), 0.21586, 1e-5);
  EXPECT_NEAR(read_mono(file, Transfer::kLinear).luminance(0), 128 / 255.0, 1e-6);
  EXPECT_NEAR(read_mono(file, Transfer::kGamma22).luminance(0), std::pow(128 / 255.0, 2.2), 1e-6);
}

TEST_F(ImageIo, ExrLuminanceIsLinearWhateverTheTransfer) {
  write_exr(folder_ / "a.exr", {2, 1, {{"Y", std::vector<float>{0.25f, 7.5f}}}, {}});
  const MonoImage image = read_mono(folder_ / "a.exr");
  EXPECT_EQ(image.depth, PixelDepth::kF32);
  EXPECT_EQ(image.luminance(0), 0.25f);
  EXPECT_EQ(image.luminance(1), 7.5f);
}

TEST_F(ImageIo, ExrOfOtherChannelsNamesThem) {
  write_exr(folder_ / "a.exr", {1, 1, {{"depth", std::vector<float>{1}}}, {}});
  try {
    (void)read_linear_image(folder_ / "a.exr", Transfer::kSrgb);
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("found depth"), std::string::npos) << error.what();
  }
}

TEST_F(ImageIo, ExrOfImplausibleLightIsRefused) {
  const fs::path file = folder_ / "a.exr";
  write_exr(file, {1, 1, {{"Y", std::vector<float>{1}}}, {}});
  // A single pixel is stored as it is, at the end.
  const auto patch = [&, bytes = read_text_file(file)](float value) {
    std::string patched = bytes;
    std::memcpy(patched.data() + patched.size() - sizeof value, &value, sizeof value);
    write_file(file, patched);
  };
  patch(7.5f);
  EXPECT_EQ(read_mono(file).luminance(0), 7.5f);
  patch(1e6f);
  EXPECT_EQ(read_mono(file).luminance(0), 1e6f);
  for (const auto& [value, found] : {std::pair{NAN, "found nan"}, {-INFINITY, "found -inf"}, {2e6f, "found 2000000"}}) {
    patch(value);
    try {
      (void)read_linear_image(file, Transfer::kSrgb);
      ADD_FAILURE() << value << " was taken";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(found), std::string::npos) << error.what();
    }
  }
}

TEST_F(ImageIo, ExrOfImplausibleCoverageIsRefused) {
  const fs::path file = folder_ / "a.exr";
  write_exr(file, {1, 1, {{"Y", std::vector<float>{1}}, {"A", std::vector<float>{0.5f}}}, {}});
  EXPECT_NO_THROW((void)read_linear_image(file, Transfer::kSrgb));
  write_exr(file, {1, 1, {{"Y", std::vector<float>{1}}, {"A", std::vector<float>{2e6f}}}, {}});
  EXPECT_THROW((void)read_linear_image(file, Transfer::kSrgb), InputError);
}

TEST_F(ImageIo, TruncatedImagesAreRefused) {
  cv::Mat noise(64, 64, CV_8UC3);
  cv::randu(noise, 0, 256);
  for (const char* name : {"a.png", "a.jpg", "a.webp", "a.tif"}) {
    const fs::path file = write(name, noise);
    EXPECT_NO_THROW((void)read_linear_image(file, Transfer::kSrgb)) << name;
    test::truncate_file(file, 0.6);
    EXPECT_THROW((void)read_linear_image(file, Transfer::kSrgb), InputError) << name;
  }
  write_exr(folder_ / "a.exr", {64, 64, {{"Y", std::vector<float>(4096, 0.5f)}}, {}});
  test::truncate_file(folder_ / "a.exr", 0.8);
  EXPECT_THROW((void)read_linear_image(folder_ / "a.exr", Transfer::kSrgb), InputError);
}

TEST_F(ImageIo, OtherFilesAreRefused) {
  write_file(folder_ / "a.png", "not an image");
  EXPECT_THROW((void)read_linear_image(folder_ / "a.png", Transfer::kSrgb), InputError);
  write_file(folder_ / "b.png", "");
  EXPECT_THROW((void)read_linear_image(folder_ / "b.png", Transfer::kSrgb), InputError);
  EXPECT_THROW((void)read_linear_image(folder_ / "c.png", Transfer::kSrgb), MissingInputError);
}

/// A JPEG file with an EXIF block that says "rotate by 90 degrees".
void add_exif_orientation(const fs::path& file) {
  std::string jpeg = read_text_file(file);
  std::string tiff("II*\0\x08\0\0\0", 8);
  tiff += std::string("\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0", 18);  // one entry: tag 0x112, short, 6
  const std::string body = std::string("Exif\0\0", 6) + tiff;
  const std::size_t length = body.size() + 2;
  const std::string segment = std::string("\xFF\xE1") + char(length >> 8) + char(length & 0xFF) + body;
  write_file(file, jpeg.substr(0, 2) + segment + jpeg.substr(2));
}

TEST_F(ImageIo, ExifOrientationIsIgnored) {
  const fs::path file = write("a.jpg", cv::Mat(20, 40, CV_8UC1, cv::Scalar(100)));
  add_exif_orientation(file);
  ASSERT_EQ(cv::imread(file).cols, 20);  // the block is understood: a viewer turns the picture
  EXPECT_EQ(read_mono(file).width, 40);
  EXPECT_EQ(read_mono(file).height, 20);
}

TEST_F(ImageIo, ResizingAveragesLinearLight) {
  cv::Mat1b image(2, 4);
  image << 0, 255, 255, 255, 0, 255, 255, 255;
  const LinearImage small =
      area_resized(luminance_image(read_linear_image(write("a.png", image), Transfer::kSrgb)), 2, 1);
  ASSERT_EQ(small.values.size(), 2u);
  EXPECT_NEAR(small.values[0], 0.5, 1e-6);  // 188 encoded, not 128
  EXPECT_NEAR(small.values[1], 1.0, 1e-6);
}

TEST_F(ImageIo, MasksIgnoreDarkPixels) {
  cv::Mat1b mask(2, 4);
  mask << 0, 255, 255, 255, 3, 250, 255, 255;
  const fs::path file = write("m.png", mask);
  EXPECT_EQ(read_mask(file, 4, 2), (std::vector<std::uint8_t>{0, 255, 255, 255, 0, 255, 255, 255}));
  EXPECT_EQ(read_mask(file, 2, 1), (std::vector<std::uint8_t>{0, 255}));  // half masked is not valid
  EXPECT_THROW((void)read_mask(file, 5, 2), InputError);
}

TEST_F(ImageIo, MasksOfOnesAreRefused) {
  const auto read = [&](int type, int lightest) {
    cv::Mat mask(2, 4, type, cv::Scalar(0));
    mask.col(1).setTo(cv::Scalar(lightest));
    return read_mask(write("m.png", mask), 4, 2);
  };
  for (const int code : {0, 2, 100, 128, 255}) EXPECT_NO_THROW((void)read(CV_8UC1, code)) << code;
  EXPECT_THROW((void)read(CV_8UC1, 1), InputError);
  EXPECT_EQ(read(CV_16UC1, 32768), (std::vector<std::uint8_t>{0, 255, 0, 0, 0, 255, 0, 0}));
  for (const int code : {0, 256, 32767}) EXPECT_NO_THROW((void)read(CV_16UC1, code)) << code;
  EXPECT_THROW((void)read(CV_16UC1, 1), InputError);
  try {
    (void)read(CV_16UC1, 255);
    FAIL() << "no error";
  } catch (const InputError& error) {
    const std::string says = "m.png: values: expected black and white, the lightest is 255 of 65535";
    EXPECT_NE(std::string(error.what()).find(says), std::string::npos) << error.what();
  }
}

TEST(SameShape, AcceptsReducedCopiesAndNothingElse) {
  EXPECT_TRUE(same_shape(640, 480, 640, 480));
  EXPECT_TRUE(same_shape(320, 240, 640, 480));
  EXPECT_TRUE(same_shape(480, 360, 640, 480));  // exactly three quarters
  EXPECT_TRUE(same_shape(136, 91, 1087, 725));  // an eighth, rounded up
  EXPECT_TRUE(same_shape(135, 90, 1087, 725));  // and down
  EXPECT_FALSE(same_shape(640, 481, 640, 480));
  EXPECT_FALSE(same_shape(1080, 1920, 1920, 1080));
  EXPECT_FALSE(same_shape(600, 480, 640, 480));
}

}  // namespace
}  // namespace cnerf
