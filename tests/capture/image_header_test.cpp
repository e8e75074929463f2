#include "src/capture/image_header.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstring>
#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/exr_io.h"
#include "src/capture/load_capture.h"
#include "src/picture/exr_writer.h"
#include "tests/capture/fixtures.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

class Headers : public testing::Test {
 protected:
  test::TempDir folder_;

  fs::path write(const std::string& name, int type) {
    cv::imwrite(folder_ / name, cv::Mat(5, 7, type, cv::Scalar::all(9)));
    return folder_ / name;
  }
  /// A PNG whose header states another size.
  fs::path png_of(std::uint32_t width, std::uint32_t height) {
    std::string content = read_text_file(write("bomb.png", CV_8UC1));
    for (const auto& [at, value] : {std::pair{16u, width}, std::pair{20u, height}}) {
      for (unsigned i = 0; i < 4; ++i) content[at + i] = char(value >> (24 - 8 * i));
    }
    write_file(folder_ / "bomb.png", content);
    return folder_ / "bomb.png";
  }
  /// An EXR whose data window is a corner of the display window.
  fs::path exr_of(int width, int height, int data_side) {
    std::vector<float> values(std::size_t(data_side) * std::size_t(data_side), 0.5f);
    Imf::Header header({{0, 0}, {width - 1, height - 1}}, {{0, 0}, {data_side - 1, data_side - 1}});
    header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
    Imf::OutputFile file((folder_ / "a.exr").c_str(), header);
    Imf::FrameBuffer frame;
    frame.insert("Y", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()), sizeof(float),
                                 sizeof(float) * std::size_t(data_side)));
    file.setFrameBuffer(frame);
    file.writePixels(data_side);
    return folder_ / "a.exr";
  }
};

void expect_header(const fs::path& file, PixelDepth depth, bool has_color, bool has_alpha) {
  const auto header = stated_header(file);
  ASSERT_TRUE(header) << file;
  EXPECT_EQ(header->width, 7) << file;
  EXPECT_EQ(header->height, 5) << file;
  EXPECT_EQ(header->depth, depth) << file;
  EXPECT_EQ(header->has_color, has_color) << file;
  EXPECT_EQ(header->has_alpha, has_alpha) << file;
}

TEST_F(Headers, TellWhatDecodingTells) {
  expect_header(write("a.png", CV_8UC1), PixelDepth::kU8, false, false);
  expect_header(write("b.png", CV_16UC3), PixelDepth::kU16, true, false);
  expect_header(write("c.png", CV_8UC4), PixelDepth::kU8, true, true);
  expect_header(write("a.jpg", CV_8UC1), PixelDepth::kU8, false, false);
  expect_header(write("b.jpg", CV_8UC3), PixelDepth::kU8, true, false);
  write_exr(folder_ / "a.exr", {7, 5, {{"Y", std::vector<float>(35, 1.0f)}}, {}});
  expect_header(folder_ / "a.exr", PixelDepth::kF32, false, false);
}

TEST_F(Headers, OfJpegFilesMayStandBehindOtherSegments) {
  const std::string plain = read_text_file(write("a.jpg", CV_8UC1));
  std::string content = plain.substr(0, 2);
  for (int i = 0; i < 9; ++i) content.append("\xFF\xE2\xFF\xF0", 4).append(0xFFEE, '\xFF');
  write_file(folder_ / "a.jpg", content + "\xFF\xFF" + plain.substr(2));
  expect_header(folder_ / "a.jpg", PixelDepth::kU8, false, false);
}

TEST_F(Headers, OfOtherFormatsAreLeftToTheDecoder) {
  EXPECT_FALSE(stated_header(write("a.tif", CV_8UC1)));
  const std::string png = read_text_file(write("a.png", CV_8UC1));
  for (std::size_t size = 0; size < 26; ++size) {
    write_file(folder_ / "cut.png", png.substr(0, size));
    EXPECT_FALSE(stated_header(folder_ / "cut.png")) << size;
  }
  const std::string jpeg = read_text_file(write("a.jpg", CV_8UC1));
  for (std::size_t size = 0; size < 20; ++size) {
    write_file(folder_ / "cut.jpg", jpeg.substr(0, size));
    EXPECT_FALSE(stated_header(folder_ / "cut.jpg")) << size;
  }
}

TEST_F(Headers, OfAbsurdSizesAreRefusedBeforeDecoding) {
  for (const auto& [width, height] : {std::pair{30'000u, 30'000u}, {0u, 5u}, {0xFFFFFFFFu, 1u}, {70'000u, 70'000u}}) {
    const fs::path file = png_of(width, height);
    const std::string size = std::to_string(width) + "x" + std::to_string(height);
    const auto message = AllOf(HasSubstr("bomb.png: size"), HasSubstr("256 Mi pixels, found " + size));
    EXPECT_THAT([&] { (void)stated_header(file); }, ThrowsMessage<InputError>(message));
    EXPECT_THAT([&] { (void)read_linear_image(file, Transfer::kSrgb); }, ThrowsMessage<InputError>(message));
    EXPECT_THAT([&] { (void)read_mask(file, 7, 5); }, ThrowsMessage<InputError>(message));
  }
}

TEST_F(Headers, OfExrWindowsThatDoNotFitAreRefused) {
  const auto refused = [&](int width, int height, const std::string& found) {
    const fs::path file = exr_of(width, height, 8);
    EXPECT_THAT([&] { (void)read_exr(file); },
                ThrowsMessage<InputError>(AllOf(HasSubstr("a.exr: displayWindow"), HasSubstr("found " + found))));
  };
  refused(20'000, 20'000, "20000x20000");
  refused(50'000, 50'000, "50000x50000");  // more than 2^31 pixels: an int would overflow
  refused(6'000, 6'000, "6000x6000");      // 64 stored pixels of 36 million
  EXPECT_EQ(read_exr(exr_of(640, 480, 8)).values[641], 0.5f) << "a crop of a picture is none of these";
}

TEST_F(Headers, PipesAreRefused) {
  ASSERT_EQ(::mkfifo((folder_ / "a.png").c_str(), 0600), 0);
  EXPECT_THROW((void)stated_header(folder_ / "a.png"), InputError);
}

/// A file of which only the header is a picture's.
void damage_pixels(const fs::path& file) {
  write_file(file, read_text_file(file).substr(0, 40));
}

TEST_F(Headers, SurveysReadNoPixels) {
  (void)test::write_transforms(folder_.path());
  const Capture whole = load_capture(folder_.path());
  for (const View& view : whole.views) damage_pixels(view.image_file);
  const Capture survey = survey_capture(folder_.path());
  ASSERT_EQ(survey.views.size(), whole.views.size());
  EXPECT_EQ(survey.format, whole.format);
  for (std::size_t v = 0; v < survey.views.size(); ++v) {
    EXPECT_EQ(survey.views[v].name, whole.views[v].name);
    EXPECT_EQ(survey.views[v].intrinsics.fx, whole.views[v].intrinsics.fx);
    EXPECT_EQ(survey.views[v].image.width, whole.views[v].image.width);
    EXPECT_EQ(survey.views[v].image.height, whole.views[v].image.height);
    EXPECT_EQ(survey.views[v].image.depth, whole.views[v].image.depth);
    EXPECT_TRUE(survey.views[v].image.u8.empty());
  }
  const Capture reduced = survey_capture(folder_.path(), {.downscale = 2});
  EXPECT_EQ(reduced.views[0].image.width, test::kWidth / 2);
  EXPECT_EQ(reduced.views[0].intrinsics.width, test::kWidth / 2);
}

TEST_F(Headers, OfAnotherShapeAreRefusedBeforeDecoding) {
  nlohmann::json top = test::write_transforms(folder_.path());
  top["w"] = test::kWidth;
  top["h"] = test::kHeight;
  test::write_json(folder_ / "transforms.json", top);
  test::write_grey_image(folder_ / "images/2.png", test::kHeight, test::kWidth);
  damage_pixels(folder_ / "images/2.png");
  EXPECT_THAT([&] { (void)load_capture(folder_.path()); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("2.png: size"), HasSubstr("found 12x16"))));
}

}  // namespace
}  // namespace cnerf
