#include "src/colorizer/gallery.h"

#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

GalleryTile tile_of(int height, int width, float lightness, float a, float b, const std::string& caption = "") {
  const auto pixels = std::size_t(height * width);
  GalleryTile tile{height, width, std::vector<float>(pixels, lightness), std::vector<float>(2 * pixels, a), caption};
  std::fill(tile.ab.begin() + std::ptrdiff_t(pixels), tile.ab.end(), b);
  return tile;
}

TEST(Gallery, PutsTilesRowByRowInTheirColours) {
  const test::TempDir folder;
  GalleryTile grey = tile_of(20, 30, 50, 0, 0);
  grey.ab.clear();
  // L*a*b* of sRGB red (color check values of CIE 1976).
  const std::vector<GalleryTile> tiles = {tile_of(20, 30, 53.241f, 80.094f, 67.203f), grey, tile_of(20, 30, 100, 0, 0)};
  write_gallery(folder / "sheet.png", tiles, 2);
  const cv::Mat sheet = cv::imread((folder / "sheet.png").string());
  ASSERT_EQ(sheet.cols, 2 * 34 + 4);
  ASSERT_EQ(sheet.rows, 2 * 24 + 4);
  const auto at = [&](int column, int row) { return sheet.at<cv::Vec3b>(row * 24 + 4 + 10, column * 34 + 4 + 15); };
  EXPECT_NEAR(at(0, 0)[2], 255, 2);
  EXPECT_NEAR(at(0, 0)[1], 0, 6);
  EXPECT_NEAR(at(0, 0)[0], 0, 6);
  EXPECT_NEAR(at(1, 0)[0], 119, 1);  // L* 50 is sRGB 119
  EXPECT_EQ(at(1, 0)[0], at(1, 0)[2]);
  EXPECT_EQ(at(0, 1), cv::Vec3b(255, 255, 255));
}

TEST(Gallery, CaptionsAddARowWithInk) {
  const test::TempDir folder;
  const std::vector<GalleryTile> tiles = {tile_of(40, 60, 0, 0, 0, "0.93"), tile_of(10, 10, 0, 0, 0)};
  write_gallery(folder / "sheet.png", tiles);
  const cv::Mat sheet = cv::imread((folder / "sheet.png").string(), cv::IMREAD_GRAYSCALE);
  ASSERT_EQ(sheet.rows, 40 + 16 + 4 + 4);
  double brightest = 0;
  cv::minMaxLoc(sheet(cv::Rect(4, 44, 60, 16)), nullptr, &brightest);
  EXPECT_GT(brightest, 150);
}

TEST(Gallery, NoTilesGiveASheetAllTheSame) {
  const test::TempDir folder;
  write_gallery(folder / "none.png", {});
  EXPECT_FALSE(cv::imread((folder / "none.png").string()).empty());
}

TEST(Gallery, RefusesWhatItCannotWrite) {
  const test::TempDir folder;
  std::ofstream(folder / "file") << "x";
  const std::vector<GalleryTile> tiles = {tile_of(4, 4, 50, 0, 0)};
  EXPECT_THROW(write_gallery(folder / "file" / "sheet.png", tiles), OutputError);
  GalleryTile cut = tiles[0];
  cut.ab.pop_back();
  EXPECT_THROW(write_gallery(folder / "sheet.png", std::vector{cut}), std::logic_error);
}

}  // namespace
}  // namespace cnerf
