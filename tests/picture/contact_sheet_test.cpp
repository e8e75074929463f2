#include "src/picture/contact_sheet.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "src/picture/curve_picture.h"

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

TEST(ContactSheet, WhatConcernsAllViewsStandsBelow) {
  ContactSheet sheet({"grey"}, 40);
  sheet.add_row({uniform_picture(30, 20, 9, 9, 9)});
  const Picture before = sheet.compose();
  sheet.add_below({uniform_picture(50, 10, 200, 10, 10), "curve"});
  sheet.add_below({uniform_picture(20, 30, 10, 200, 10), "sky"});
  const Picture after = sheet.compose();
  EXPECT_EQ(pixels_of(after, 9, 9, 9), 600u);
  EXPECT_EQ(pixels_of(after, 200, 10, 10), 500u);
  EXPECT_EQ(pixels_of(after, 10, 200, 10), 600u);
  EXPECT_GE(after.height, before.height + 30);
  EXPECT_GE(after.width, 70);
}

/// The row of the first of the darkest pixels of a column: above the middle of a dot by its radius.
int ink_row(const Picture& picture, int x) {
  int darkest = 0;
  for (int y = 0; y < picture.height; ++y) {
    const auto red = [&](int row) { return picture.rgb[3 * std::size_t(row * picture.width + x)]; };
    if (red(y) < red(darkest)) darkest = y;
  }
  return darkest;
}

TEST(CurvePicture, GoesThroughItsValues) {
  const std::vector<double> values = {1, 2, 0.5};
  const Picture picture = curve_picture(values, 1, 101, 61);
  ASSERT_EQ(picture.rgb.size(), 3u * 101 * 61);
  EXPECT_NEAR(ink_row(picture, 50) + 2, 6, 1) << "the largest value";
  EXPECT_NEAR(ink_row(picture, 94) + 2, 54, 1) << "the smallest";
  EXPECT_NEAR(ink_row(picture, 6) + 2, 38, 1) << "a third of the way up";
  EXPECT_EQ(pixels_of(curve_picture({}, {}, 20, 10), 250, 250, 250), 200u) << "nothing to draw";
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
