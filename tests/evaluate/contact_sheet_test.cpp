#include "src/evaluate/contact_sheet.h"

#include <gtest/gtest.h>

#include "src/base/error.h"
#include "src/base/files.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

Picture uniform_picture(int width, int height, std::uint8_t r, std::uint8_t g, std::uint8_t b) {
  Picture picture{width, height, {}};
  for (int i = 0; i < width * height; ++i) picture.rgb.insert(picture.rgb.end(), {r, g, b});
  return picture;
}

std::size_t pixels_of(const Picture& sheet, std::uint8_t r, std::uint8_t g, std::uint8_t b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < sheet.rgb.size(); i += 3) {
    count += sheet.rgb[i] == r && sheet.rgb[i + 1] == g && sheet.rgb[i + 2] == b;
  }
  return count;
}

TEST(ContactSheet, ShowsEveryPictureWholeAndLeavesEmptyColumnsOut) {
  ContactSheet sheet({"grey", "ours", "truth"}, 40);
  sheet.add_row({uniform_picture(30, 20, 9, 9, 9), uniform_picture(30, 20, 200, 10, 10), {}});
  sheet.add_row({uniform_picture(80, 60, 8, 8, 8), uniform_picture(80, 60, 10, 200, 10), {}});
  const Picture picture = sheet.compose();
  EXPECT_EQ(pixels_of(picture, 9, 9, 9), 600u);
  EXPECT_EQ(pixels_of(picture, 200, 10, 10), 600u);
  EXPECT_EQ(pixels_of(picture, 10, 200, 10), 1200u) << "80x60 becomes 40x30";
  EXPECT_LT(picture.width, 3 * 40) << "the column without pictures takes no room";
}

TEST(ContactSheet, GreyAndColourComeFromLinearLight) {
  EXPECT_EQ(picture_from_linear(1, 2, {1.0f, 0.0f}).rgb, (std::vector<std::uint8_t>{255, 255, 255, 0, 0, 0}));
  // 0.318547 is the linear light of sRGB 0.6, which is 153.
  EXPECT_EQ(picture_from_linear(1, 1, {0.318547f, 0.0f, 2.0f}).rgb, (std::vector<std::uint8_t>{153, 0, 255}));
}

TEST(ContactSheet, WritesAPngOrNothing) {
  const test::TempDir folder;
  write_png(folder / "sheet.png", uniform_picture(4, 4, 1, 2, 3));
  const auto bytes = read_binary_file(folder / "sheet.png");
  EXPECT_EQ(std::to_integer<int>(bytes.at(1)), 'P');
  write_file(folder / "a-file", std::string_view("x"));
  EXPECT_THROW(write_png(folder / "a-file" / "sheet.png", uniform_picture(4, 4, 1, 2, 3)), OutputError);
}

}  // namespace
}  // namespace cnerf
