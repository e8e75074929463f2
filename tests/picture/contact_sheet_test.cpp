#include "src/picture/contact_sheet.h"

#include <gtest/gtest.h>

#include <algorithm>

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

TEST(Tiles, LieRowByRow) {
  const std::vector<Tile> tiles = {{uniform_picture(30, 20, 200, 10, 10), ""},
                                   {uniform_picture(30, 20, 119, 119, 119), ""},
                                   {uniform_picture(30, 20, 255, 255, 255), ""}};
  const Picture sheet = tiled(tiles, 2);
  ASSERT_EQ(sheet.width, 2 * 34 + 4);
  ASSERT_EQ(sheet.height, 2 * 24 + 4);
  const auto at = [&](int column, int row) {
    return &sheet.rgb[3 * std::size_t((row * 24 + 4 + 10) * sheet.width + column * 34 + 4 + 15)];
  };
  EXPECT_EQ(at(0, 0)[0], 200);
  EXPECT_EQ(at(0, 0)[1], 10);
  EXPECT_EQ(at(1, 0)[2], 119);
  EXPECT_EQ(at(0, 1)[1], 255);
  EXPECT_EQ(at(1, 1)[1], kSheetBackground);
}

TEST(Tiles, CaptionsAddARowWithInk) {
  const std::vector<Tile> tiles = {{uniform_picture(60, 40, 0, 0, 0), "0.93"}, {uniform_picture(10, 10, 0, 0, 0), ""}};
  const Picture sheet = tiled(tiles);
  ASSERT_EQ(sheet.height, 40 + 16 + 4 + 4);
  const auto caption = sheet.rgb.begin() + 3 * 44 * sheet.width;
  EXPECT_GT(*std::max_element(caption, sheet.rgb.end()), 150);
}

TEST(Tiles, NoneGiveASheetWithOneEmptyCell) {
  const Picture sheet = tiled({});
  EXPECT_EQ(pixels_of(sheet, kSheetBackground, kSheetBackground, kSheetBackground), sheet.rgb.size() / 3);
  EXPECT_GT(sheet.width, 0);
}

}  // namespace
}  // namespace cnerf
