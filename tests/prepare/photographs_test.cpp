#include "src/prepare/photographs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <numeric>
#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/exr_io.h"
#include "src/color/colorspace_math.h"
#include "src/picture/exr_writer.h"
#include "tests/support/data.h"
#include "tests/support/exif_jpeg.h"
#include "tests/support/upright.h"

namespace cnerf::prepare {
namespace {
namespace fs = std::filesystem;
using test::exif_block;
using test::Upright;
using testing::HasSubstr;

cv::Mat1b ramp(int width, int height, int seed = 0) {
  cv::Mat1b image(height, width);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image(y, x) = std::uint8_t(7 * x + 11 * y + seed);
  }
  return image;
}

void write(const fs::path& file, const cv::Mat& image) {
  fs::create_directories(file.parent_path());
  ASSERT_TRUE(cv::imwrite(file.string(), image));
}

void write_jpeg(const fs::path& file, const cv::Mat& image, const std::string& exif) {
  write_file(file, test::jpeg_with(exif, image));
}

PhotographSet import_all(const fs::path& folder, const fs::path& capture, const SensorOptions& sensor = {},
                         const fs::path& masks = {}) {
  return import_photographs(list_photographs(folder), capture, masks, sensor, {});
}

cv::Mat stored(const fs::path& file) {
  return cv::imread(file.string(), cv::IMREAD_UNCHANGED);
}

TEST(Photographs, GreyEightBitKeepsItsCodes) {
  const test::TempDir folder;
  write(folder / "in/a.png", ramp(31, 17));
  write(folder / "in/b.tiff", ramp(31, 17, 5));
  const PhotographSet set = import_all(folder / "in", folder / "out");
  ASSERT_EQ(set.images.size(), 2u);
  EXPECT_EQ(set.images[0].name, "a.png");
  const cv::Mat a = stored(folder / "out/images/a.png"), b = stored(folder / "out/images/b.png");
  ASSERT_EQ(a.type(), CV_8UC1);
  EXPECT_EQ(cv::norm(a, ramp(31, 17), cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(b, ramp(31, 17, 5), cv::NORM_INF), 0);
  EXPECT_EQ(set.images[0].camera, set.images[1].camera);
}

TEST(Photographs, SixteenBitsAndFloatsKeepTheirDepth) {
  const test::TempDir folder;
  cv::Mat1w deep(8, 9);
  for (int i = 0; i < 72; ++i) deep(i / 9, i % 9) = std::uint16_t(900 * i + 3);
  write(folder / "in/deep.png", deep);
  const std::vector<float> light = {0, 0.25f, 0.5f, 1.5f, 2, 3, 4, 5, 6, 7, 8, 9};
  write_exr(folder / "in/float.exr", {4, 3, {{"Y", light}}, {}});
  const PhotographSet set = import_all(folder / "in", folder / "out");
  const cv::Mat back = stored(folder / "out/images/deep.png");
  ASSERT_EQ(back.type(), CV_16UC1);
  EXPECT_LE(cv::norm(back, deep, cv::NORM_INF), 1);  // through linear light in floats
  EXPECT_EQ(read_exr(folder / "out/images/float.exr").values, light);
  EXPECT_NE(set.images[0].camera, set.images[1].camera) << "sizes differ";
}

TEST(Photographs, FloatsKeepTheirAlpha) {
  const test::TempDir folder;
  const std::vector<float> light = {0, 0.25f, 0.5f, 1.5f}, alpha = {0, 0.5f, 1, 1};
  for (const char* name : {"in/float.exr", "in/other.exr"}) {
    write_exr(folder / name, {2, 2, {{"Y", light}, {"A", alpha}}, {}});
  }
  (void)import_all(folder / "in", folder / "out");
  EXPECT_EQ(read_exr(folder / "out/images/float.exr").alpha, alpha);
  EXPECT_EQ(read_exr(folder / "out/images/float.exr").values, light);
}

TEST(Photographs, ColoursBecomeTheirLuminance) {
  const test::TempDir folder;
  write(folder / "in/a.png", cv::Mat(6, 8, CV_8UC3, cv::Scalar(10, 200, 90)));
  write(folder / "in/b.png", cv::Mat(6, 8, CV_8UC3, cv::Scalar(77, 77, 77)));
  (void)import_all(folder / "in", folder / "out");
  const cv::Mat a = stored(folder / "out/images/a.png"), b = stored(folder / "out/images/b.png");
  ASSERT_EQ(a.channels(), 1);
  const auto light = [](int code) { return linear_from_srgb(code / 255.0); };
  const double luminance = luminance_of<double>({light(90), light(200), light(10)});
  EXPECT_EQ(int(a.at<std::uint8_t>(0)), int(std::lround(255 * srgb_from_linear(luminance))));
  EXPECT_EQ(int(b.at<std::uint8_t>(0)), 77);
}

TEST(Photographs, ExifTurnsUprightAndTellsTheLens) {
  // Upright, the bright corner is at the top left in every one of the eight orientations.
  for (int orientation = 1; orientation <= 8; ++orientation) {
    const Upright grid = {orientation, 64, 32};
    cv::Mat1b image(32, 64, std::uint8_t(30));
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 8; ++x) image(int(grid.stored_index(x, y)) / 64, int(grid.stored_index(x, y)) % 64) = 220;
    }
    const test::TempDir folder;
    write_jpeg(folder / "in/a.jpg", image, exif_block(orientation, 26, 28));
    write_jpeg(folder / "in/b.jpg", image, exif_block(orientation, 50, 75));
    const PhotographSet set = import_all(folder / "in", folder / "out");
    const cv::Mat upright = stored(folder / "out/images/a.png");
    EXPECT_EQ(upright.cols, orientation < 5 ? 64 : 32) << orientation;
    EXPECT_GT(upright.at<std::uint8_t>(3, 3), 180) << orientation;
    EXPECT_LT(upright.at<std::uint8_t>(upright.rows - 4, upright.cols - 4), 60) << orientation;
    EXPECT_NEAR(set.images[0].focal, 28.0 / 36 * 64, 1e-9);
    EXPECT_NEAR(set.images[1].focal, 75.0 / 36 * 64, 1e-9);
    EXPECT_NE(set.images[0].camera, set.images[1].camera) << "two focal lengths";
  }
}

/// An uncompressed grey TIFF whose only directory says how it is turned.
std::string tiff(const cv::Mat1b& image, int orientation) {
  std::string file = "II*";
  const auto put = [&](std::uint32_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) file += char(value >> (8 * i));
  };
  const auto entry = [&](int tag, int type, std::uint32_t value) {
    put(std::uint32_t(tag), 2);
    put(std::uint32_t(type), 2);
    put(1, 4);
    put(value, 4);
  };
  constexpr int kShort = 3, kLong = 4;
  constexpr std::uint32_t kEntries = 10, kData = 8 + 2 + 12 * kEntries + 4;
  put(0, 1);
  put(8, 4);
  put(kEntries, 2);
  entry(256, kLong, std::uint32_t(image.cols));
  entry(257, kLong, std::uint32_t(image.rows));
  entry(258, kShort, 8);
  entry(259, kShort, 1);  // no compression
  entry(262, kShort, 1);  // black is 0
  entry(273, kLong, kData);
  entry(274, kShort, std::uint32_t(orientation));
  entry(277, kShort, 1);  // samples per pixel
  entry(278, kLong, std::uint32_t(image.rows));
  entry(279, kLong, std::uint32_t(image.total()));
  put(0, 4);
  return file.append(reinterpret_cast<const char*>(image.data), image.total());
}

TEST(Photographs, TiffsAreTurnedUprightOnce) {
  for (const int orientation : {1, 3, 6, 8}) {
    const Upright grid = {orientation, 64, 32};
    cv::Mat1b image(32, 64, std::uint8_t(30));
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 8; ++x) image(int(grid.stored_index(x, y)) / 64, int(grid.stored_index(x, y)) % 64) = 220;
    }
    const test::TempDir folder;
    write_file(folder / "in/a.tif", tiff(image, orientation));
    write_file(folder / "in/b.tif", tiff(image, 1));
    (void)import_all(folder / "in", folder / "out");
    const cv::Mat upright = stored(folder / "out/images/a.png");
    EXPECT_EQ(upright.cols, orientation < 5 ? 64 : 32) << orientation;
    EXPECT_GT(upright.at<std::uint8_t>(3, 3), 180) << orientation;
  }
}

/// What a file is, its content says: OpenCV turns TIFF files, whatever they are called, and no JPEG.
TEST(Photographs, TheContentSaysWhoTurnsAPhotograph) {
  const auto orientation = [](const std::string& file) { return orientation_of(std::as_bytes(std::span(file))); };
  EXPECT_EQ(orientation(test::turned_photograph(6)), 6);
  EXPECT_EQ(orientation(tiff(ramp(20, 10), 6)), 1);
  const test::TempDir folder;
  for (const char* name : {"in/a.tif", "in/b.tif"}) write_file(folder / name, test::turned_photograph(6));
  EXPECT_EQ(import_all(folder / "in", folder / "out").images.at(0).width, 40);
}

TEST(Photographs, EveryOrientationIsTurnedUpright) {
  LinearImage lying{5, 3, 3, PixelDepth::kU8, std::vector<float>(45), std::vector<float>(15)};
  std::iota(lying.values.begin(), lying.values.end(), 1.0f);
  std::iota(lying.alpha.begin(), lying.alpha.end(), 100.0f);
  for (int orientation = 1; orientation <= 8; ++orientation) {
    const Upright grid = {orientation, 5, 3};
    const LinearImage upright = turned_upright(lying, orientation);
    ASSERT_EQ(upright.width, grid.width()) << orientation;
    ASSERT_EQ(upright.height, grid.height()) << orientation;
    std::size_t at = 0;
    for (int y = 0; y < upright.height; ++y) {
      for (int x = 0; x < upright.width; ++x, ++at) {
        const std::size_t from = grid.stored_index(x, y);
        EXPECT_EQ(upright.alpha.at(at), lying.alpha.at(from)) << orientation;
        for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(upright.values.at(3 * at + c), lying.values.at(3 * from + c));
      }
    }
  }
  // As EXIF numbers them: in 6 the stored image has to be turned clockwise, so its bottom left comes to the top left.
  EXPECT_EQ((Upright{6, 5, 3}.stored_index(0, 0)), 2u * 5);
  EXPECT_EQ((Upright{3, 5, 3}.stored_index(0, 0)), 14u);
  EXPECT_EQ((Upright{8, 5, 3}.stored_index(0, 0)), 4u);
}

TEST(Photographs, BrokenNotesAreIgnored) {
  const test::TempDir folder;
  std::string broken = exif_block(6, 26, 28);
  for (std::size_t i = 14; i < broken.size(); ++i) broken[i] = char(0xEE);
  write_jpeg(folder / "in/a.jpg", ramp(20, 10), broken);
  write_jpeg(folder / "in/b.jpg", ramp(20, 10), exif_block(6, 26, 28).substr(0, 20));
  EXPECT_EQ(import_all(folder / "in", folder / "out").images.size(), 2u);
}

TEST(Photographs, LevelsOfASensorAreApplied) {
  const test::TempDir folder;
  cv::Mat1w raw(2, 3);
  raw(0, 0) = 64, raw(0, 1) = 4095, raw(0, 2) = 64 + 4031 / 2, raw(1, 0) = 0, raw(1, 1) = 5000, raw(1, 2) = 1071;
  write(folder / "in/a.png", raw);
  write(folder / "in/b.png", raw);
  SensorOptions sensor;
  sensor.transfer = "linear";
  sensor.black_level = 64;
  sensor.white_level = 4095;
  (void)import_all(folder / "in", folder / "out", sensor);
  const cv::Mat1w a = stored(folder / "out/images/a.png");
  const auto light = [&](int y, int x) { return linear_from_srgb(a(y, x) / 65535.0); };
  EXPECT_EQ(a(0, 0), 0);
  EXPECT_EQ(a(0, 1), 65535);
  EXPECT_EQ(a(1, 0), 0) << "below black";
  EXPECT_EQ(a(1, 1), 65535) << "above white";
  EXPECT_NEAR(light(0, 2), 0.5, 2e-4);
  EXPECT_NEAR(light(1, 2), (1071 - 64) / 4031.0, 2e-4);
}

TEST(Photographs, LevelsThatTheirCodesCannotHaveAreRefused) {
  EXPECT_EQ(levels_of({}, 255, "a.png").white, 255);
  EXPECT_EQ(levels_of({"linear", 64, 4095}, 65535, "a.png").white, 4095);
  EXPECT_THROW((void)levels_of({"linear", 64, 4095}, 255, "a.png"), UsageError);
  EXPECT_THROW((void)levels_of({"linear", 256, 0}, 255, "a.png"), UsageError);
  EXPECT_THROW((void)levels_of({"linear", 100, 100}, 255, "a.png"), UsageError);
  EXPECT_THROW((void)levels_of({"linear", 200, 100}, 65535, "a.png"), UsageError);
}

TEST(Photographs, UnreadableOnesAreNamedAndLeftOut) {
  const test::TempDir folder;
  write(folder / "in/a.png", ramp(20, 10));
  write(folder / "in/b.png", ramp(20, 10));
  write_file(folder / "in/c.jpg", std::string_view("not an image"));
  const PhotographSet set = import_all(folder / "in", folder / "out");
  EXPECT_EQ(set.images.size(), 2u);
  ASSERT_EQ(set.unreadable.size(), 1u);
  EXPECT_THAT(set.unreadable[0], HasSubstr("c.jpg"));
  fs::remove(folder / "in/b.png");
  EXPECT_THROW((void)import_all(folder / "in", folder / "out"), InputError) << "one is too few";
}

TEST(Photographs, HeicIsRefusedWithTheCommandThatConverts) {
  const test::TempDir folder;
  write(folder / "in/a.png", ramp(20, 10));
  write_file(folder / "in/b.HEIC", std::string_view("ftypheic"));
  try {
    (void)list_photographs(folder / "in");
    FAIL() << "not refused";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("b.HEIC"));
    EXPECT_THAT(error.what(), HasSubstr("heif-convert"));
  }
}

TEST(Photographs, MasksFollowTheirPhotograph) {
  const test::TempDir folder;
  write(folder / "in/one two.png", ramp(20, 10));
  write(folder / "in/b.png", ramp(20, 10, 3));
  cv::Mat1b mask(10, 20, std::uint8_t(255));
  mask.colRange(0, 5) = 0;
  write(folder / "masks/b.png.png", mask);
  const PhotographSet set = import_all(folder / "in", folder / "out", {}, folder / "masks");
  EXPECT_EQ(set.images[0].name, "b.png");
  EXPECT_EQ(set.images[0].mask, "masks/b.png");
  EXPECT_EQ(set.images[1].name, "one_two.png");
  EXPECT_TRUE(set.images[1].mask.empty());
  EXPECT_EQ(cv::norm(stored(folder / "out/masks/b.png"), mask, cv::NORM_INF), 0);
  fs::remove(folder / "masks/b.png.png");
  write(folder / "masks/other.png", mask);
  EXPECT_THROW((void)import_all(folder / "in", folder / "out", {}, folder / "masks"), InputError);
}

TEST(Photographs, MasksOfThoseOnTheirSideAreAsStoredOrAsShown) {
  for (const int orientation : {5, 6, 7, 8}) {
    const Upright grid = {orientation, 64, 32};
    cv::Mat1b shown(64, 32, std::uint8_t(255)), as_stored(32, 64);
    shown.rowRange(0, 10) = 0;
    for (int y = 0; y < shown.rows; ++y) {
      for (int x = 0; x < shown.cols; ++x) {
        const int at = int(grid.stored_index(x, y));
        as_stored(at / 64, at % 64) = shown(y, x);
      }
    }
    const test::TempDir folder;
    for (const char* name : {"in/a.jpg", "in/b.jpg"}) {
      write_jpeg(folder / name, ramp(64, 32), exif_block(orientation, 26, 28));
    }
    write(folder / "masks/a.png", shown);
    write(folder / "masks/b.png", as_stored);
    ASSERT_EQ(import_all(folder / "in", folder / "out", {}, folder / "masks").images.size(), 2u) << orientation;
    for (const char* mask : {"out/masks/a.png", "out/masks/b.png"}) {
      EXPECT_EQ(cv::norm(stored(folder / mask), shown, cv::NORM_INF), 0) << orientation << " " << mask;
    }
  }
}

TEST(Photographs, AMaskThatDoesNotFitIsRefused) {
  const test::TempDir folder;
  for (const char* name : {"in/a.png", "in/b.png", "in/c.png"}) write(folder / name, ramp(20, 10));
  write(folder / "masks/a.png", cv::Mat1b(10, 20, std::uint8_t(255)));
  write(folder / "masks/b.png", cv::Mat1b(7, 7, std::uint8_t(255)));
  EXPECT_THAT([&] { (void)import_all(folder / "in", folder / "out", {}, folder / "masks"); },
              testing::ThrowsMessage<InputError>(HasSubstr("masks/b.png")));
}

TEST(Photographs, AreFoundByTheirOwnNamesFirst) {
  std::vector<PreparedImage> images(3);
  images[0].name = "a_jpg.png", images[0].source = "in/a.jpg";
  images[1].name = "a_jpg_2.png", images[1].source = "in/a_jpg.tif";
  images[2].name = "a_png.png", images[2].source = "in/a.png";
  const ImagePlaces places(images);
  EXPECT_EQ(places.of("a_jpg.png"), 0u);
  EXPECT_EQ(places.of("other/a_jpg.jpg"), 0u) << "by the stem of its own name";
  EXPECT_EQ(places.of("a_jpg.tif"), 1u);
  EXPECT_EQ(places.of("a_jpg_2.jpg"), 1u);
  EXPECT_EQ(places.of("cam/a.jpg"), 0u) << "two photographs of one stem";
  EXPECT_EQ(places.of("cam/a.png"), 2u);
  EXPECT_EQ(places.of("b.png"), std::nullopt);
}

TEST(Photographs, AFolderWithoutAnyIsRefused) {
  const test::TempDir folder;
  EXPECT_THROW((void)list_photographs(folder / "nowhere"), MissingInputError);
  EXPECT_THROW((void)list_photographs(folder.path()), MissingInputError);
}

}  // namespace
}  // namespace cnerf::prepare
