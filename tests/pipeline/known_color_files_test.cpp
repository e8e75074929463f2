// Key frames and hints as a user names them.

#include "src/pipeline/known_color_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/picture/encode.h"
#include "src/train/chroma/strokes.h"
#include "tests/support/data.h"
#include "tests/support/exif_jpeg.h"
#include "tests/support/upright.h"

namespace cnerf::pipeline {
namespace {
namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// A picture of one colour.
Picture plain(int width, int height, std::uint8_t r, std::uint8_t g, std::uint8_t b) {
  Picture picture{width, height, {}};
  for (int i = 0; i < width * height; ++i) picture.rgb.insert(picture.rgb.end(), {r, g, b});
  return picture;
}

class KnownColorFiles : public ::testing::Test {
 protected:
  KnownColorFiles() {
    for (const char* name : {"images/a.png", "images/b.png", "images/held.png"}) {
      View view;
      view.name = name;
      view.image_file = folder_ / fs::path(name).filename().string();
      view.intrinsics.width = 20, view.intrinsics.height = 10;
      view.held_out = view.name == "images/held.png";
      write_png(view.image_file, plain(40, 20, 90, 90, 90));
      capture_.views.push_back(view);
    }
    write_png(folder_ / "red.png", plain(40, 20, 200, 30, 30));
    write_png(folder_ / "grey.png", plain(40, 20, 90, 90, 90));
    write_png(folder_ / "square.png", plain(20, 20, 200, 30, 30));
  }
  std::string at(const std::string& name) { return (folder_ / name).string(); }
  template <typename E>
  std::string refusal(const ColorizerOptions& config) {
    try {
      (void)load_known_colors(capture_, config);
    } catch (const E& error) {
      return error.what();
    }
    ADD_FAILURE() << "was not refused, or by another error";
    return "";
  }
  test::TempDir folder_;
  Capture capture_;
};

TEST_F(KnownColorFiles, KeyFramesComeFirstThenHints) {
  ColorizerOptions config;
  config.keyframes = "b=" + at("red.png") + "; images/a.png=" + at("red.png");
  config.hints = "10,10,a,#00ff00;39.5,0,b.png,#0000ff";
  const std::vector<KnownColors> known = load_known_colors(capture_, config).known;
  ASSERT_EQ(known.size(), 4u);
  EXPECT_EQ(known[0].view, "images/b.png");
  EXPECT_EQ(known[1].view, "images/a.png");
  EXPECT_EQ(known[0].kind, KnownColorKind::kKeyFrame);
  EXPECT_GT(known[0].ab[0].a, 40) << "red";
  EXPECT_EQ(known[2].kind, KnownColorKind::kStrokes);
  // (10, 10) of a file of 40 x 20 is (5, 5) of the view of 20 x 10.
  EXPECT_EQ(known[2].is_known[5 * 20 + 5], 1);
  EXPECT_EQ(known[2].is_known[0], 0);
  EXPECT_LT(known[2].ab[5 * 20 + 5].a, -50) << "green";
  EXPECT_EQ(known[3].is_known[19], 1) << "the corner";
}

TEST_F(KnownColorFiles, APhotographIsTurnedAsTheViewIs) {
  ColorizerOptions config;
  config.keyframes = "a=" + at("photo.jpg");
  for (int orientation = 1; orientation <= 8; ++orientation) {
    write_file(folder_ / "photo.jpg", test::turned_photograph(orientation));
    const KnownColors known = load_known_colors(capture_, config).known.at(0);
    ASSERT_EQ(known.width, 40) << orientation;
    EXPECT_GT(known.ab[10 * 40 + 5].b, 20) << "red, orientation " << orientation;
    EXPECT_LT(known.ab[10 * 40 + 35].b, -40) << "blue, orientation " << orientation;
  }
  write_file(folder_ / "photo.jpg", test::turned_photograph(3));
  capture_.views[0].image_file = folder_ / "photo.jpg";
  const KnownColors known = load_known_colors(capture_, config).known.at(0);
  EXPECT_LT(known.ab[10 * 40 + 5].b, -40) << "the view itself is read as it is stored";
}

TEST_F(KnownColorFiles, AnUprightPictureIsLaidAsTheViewsPixelsAre) {
  View& view = capture_.views[0];
  view.image_file = folder_ / "photo.jpg";
  ColorizerOptions config;
  config.keyframes = "a=" + at("upright.png");
  cv::Mat3b upright(20, 40, cv::Vec3b(200, 30, 30));       // B G R
  upright.colRange(0, 20).setTo(cv::Scalar(30, 30, 200));  // red on the left
  ASSERT_TRUE(cv::imwrite(at("upright.png"), upright));
  for (int orientation = 2; orientation <= 8; ++orientation) {
    write_file(view.image_file, test::turned_photograph(orientation));
    const test::Upright grid = {orientation, orientation > 4 ? 20 : 40, orientation > 4 ? 40 : 20};
    view.intrinsics.width = grid.stored_width, view.intrinsics.height = grid.stored_height;
    const KnownColors known = load_known_colors(capture_, config).known.at(0);
    ASSERT_EQ(known.width, grid.stored_width) << orientation;
    EXPECT_GT(known.ab[grid.stored_index(5, 10)].b, 20) << "red, orientation " << orientation;
    EXPECT_LT(known.ab[grid.stored_index(35, 10)].b, -40) << "blue, orientation " << orientation;
  }
}

TEST_F(KnownColorFiles, AViewsOwnNameMeansItBeforeTheNamesOfOthersFiles) {
  capture_.views[0].name = "a.png";
  capture_.views[1].name = "left/a.png";
  EXPECT_EQ(view_called(capture_, "a.png", "--hint"), 0u);
  EXPECT_EQ(view_called(capture_, "left/a.png", "--hint"), 1u);
  EXPECT_EQ(view_called(capture_, "left_a", "--hint", {"a", "left_a", "held"}), 1u);
  EXPECT_THAT([&] { (void)view_called(capture_, "a", "--hint"); },
              ::testing::ThrowsMessage<UsageError>(HasSubstr("--hint: 2 views of the capture are called a;")));
  EXPECT_THAT([&] { (void)view_called(capture_, "b", "--hint"); },
              ::testing::ThrowsMessage<UsageError>(HasSubstr("no views of the capture are called b")));
}

TEST_F(KnownColorFiles, ADotHasAPlace) {
  ColorizerOptions config;
  for (const char* number : {"nan", "inf", "-inf"}) {
    config.hints = std::string(number) + ",5,a,#ff0000";
    EXPECT_THAT(refusal<UsageError>(config), HasSubstr(number)) << number;
    config.hints = "5," + std::string(number) + ",a,#ff0000";
    EXPECT_THAT(refusal<UsageError>(config), HasSubstr("for a number")) << number;
  }
}

/// Else each would run over those before it.
TEST_F(KnownColorFiles, DotsOfOneViewAreOneSource) {
  ColorizerOptions config;
  config.hints = "10,10,a,#00ff00;30,10,b,#0000ff;14,10,a,#ff0000;12,10,images/a.png,#0000ff";
  const std::vector<KnownColors> known = load_known_colors(capture_, config).known;
  ASSERT_EQ(known.size(), 2u);
  EXPECT_EQ(known[0].view, "images/b.png");
  EXPECT_EQ(known[1].view, "images/a.png") << "which was hinted at last";
  const auto color_at = [&](int x) { return known[1].ab[std::size_t(5 * 20 + x)].a; };
  for (int x = 4; x < 8; ++x) EXPECT_EQ(known[1].is_known[std::size_t(5 * 20 + x)], 1) << x;
  EXPECT_EQ(color_at(4), ab_of_hex("#00ff00")->a) << "half of its dot is left";
  EXPECT_EQ(color_at(6), ab_of_hex("#0000ff")->a) << "the last lies on top";
  EXPECT_EQ(color_at(7), ab_of_hex("#ff0000")->a);
}

TEST_F(KnownColorFiles, OfAHintPictureOnlyTheStrokesCount) {
  cv::Mat4b strokes(20, 40, cv::Vec4b(0, 0, 0, 0));
  strokes.at<cv::Vec4b>(6, 31) = {30, 30, 200, 255};  // B G R A
  strokes.at<cv::Vec4b>(7, 31) = {30, 30, 200, 60};   // too faint
  cv::imwrite(at("strokes.png"), strokes);
  ColorizerOptions config;
  config.hint_images = "a=" + at("strokes.png");
  const std::vector<KnownColors> known = load_known_colors(capture_, config).known;
  ASSERT_EQ(known.size(), 1u);
  EXPECT_EQ(known[0].kind, KnownColorKind::kStrokes);
  EXPECT_EQ(std::accumulate(known[0].is_known.begin(), known[0].is_known.end(), 0), 1);
  EXPECT_EQ(known[0].is_known[6 * 40 + 31], 1);
  EXPECT_GT(known[0].ab[6 * 40 + 31].a, 40) << "red";

  cv::imwrite(at("empty.png"), cv::Mat4b(20, 40, cv::Vec4b(0, 0, 0, 0)));
  config.hint_images = "a=" + at("empty.png");
  EXPECT_THAT(refusal<InputError>(config), HasSubstr("nothing is painted"));
}

TEST_F(KnownColorFiles, StrokeFilesPaintViewsAndViewpoints) {
  const LensRecord lens = {16, 12, 14, 14, 8, 6};
  const CameraRecord camera = {{0, 0, 0}, {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, lens};
  StrokeList list{1, {}, {{"unpainted", camera}, {"viewpoint-1", camera}}};
  for (const char* view : {"viewpoint-1", "images/b.png"}) {
    Stroke stroke{.id = "s" + std::to_string(list.strokes.size()), .view = view, .color = "#ff0000", .size = 0.3f};
    stroke.points = {{0.5f, 0.5f, 1}};
    list.strokes.push_back(stroke);
  }
  write_strokes(at("strokes.json"), list);
  ColorizerOptions config;
  config.strokes = at("strokes.json");
  const GivenColors given = load_known_colors(capture_, config);
  ASSERT_EQ(given.viewpoints.size(), 1u) << "those that are painted";
  EXPECT_EQ(given.viewpoints[0].name, "viewpoint-1");
  ASSERT_EQ(given.known.size(), 2u);
  EXPECT_EQ(given.known[0].view, "images/b.png") << "the capture's views come first";
  EXPECT_EQ(given.known[1].view, "viewpoint-1");
  EXPECT_EQ(given.known[1].width, lens.width);
  EXPECT_EQ(given.known[1].is_known[6 * 16 + 8], 1);
  EXPECT_FALSE(given.known[0].everywhere);
  list.everywhere = true;
  write_strokes(at("strokes.json"), list);
  for (const KnownColors& known : load_known_colors(capture_, config).known) EXPECT_TRUE(known.everywhere);
}

TEST_F(KnownColorFiles, APaletteColorsTheHintsThatNameItsWords) {
  ColorizerOptions config;
  config.hints = "10,10,a,jacket;30,10,a,jacket;10,10,b,#0000ff;30,10,b,the wall";
  config.palette = "jacket=#00ff00, the wall=#ff0000";
  const auto dot = [&](std::size_t view, int x) {
    return load_known_colors(capture_, config).known.at(view).ab[5 * 20 + std::size_t(x)];
  };
  const Ab green = *ab_of_hex("#00ff00"), red = *ab_of_hex("#ff0000"), blue = *ab_of_hex("#0000ff");
  EXPECT_EQ(dot(0, 5).a, green.a);
  EXPECT_EQ(dot(0, 15).a, green.a);
  EXPECT_EQ(dot(1, 5).a, blue.a);
  EXPECT_EQ(dot(1, 15).a, red.a);
  config.palette = "jacket=#ff0000;the wall=#ff0000";
  EXPECT_EQ(dot(0, 5).a, red.a) << "one word, all its hints";
  EXPECT_EQ(dot(0, 15).a, red.a);
  EXPECT_EQ(dot(1, 5).a, blue.a);
}

TEST_F(KnownColorFiles, APaletteColorsTheStrokesThatHaveItsWords) {
  StrokeList list;
  list.strokes = {{"a1", "images/a.png", "paint", "#0000ff"}, {"b1", "images/b.png", "paint", "#0000ff"}};
  for (Stroke& stroke : list.strokes) {
    stroke.points = {{0.5f, 0.5f, 1}};
    stroke.size = 0.3f;
  }
  list.strokes[0].word = "jacket";
  write_strokes(folder_ / "strokes.json", list);
  ColorizerOptions config;
  config.strokes = at("strokes.json");
  const auto painted_a = [&](std::size_t index) {
    const KnownColors known = load_known_colors(capture_, config).known.at(index);
    return known.ab[std::size_t(std::ranges::find(known.is_known, 1) - known.is_known.begin())].a;
  };
  EXPECT_EQ(painted_a(0), ab_of_hex("#0000ff")->a) << "without a palette as it was painted";
  config.palette = "jacket=#00ff00";
  EXPECT_EQ(painted_a(0), ab_of_hex("#00ff00")->a);
  EXPECT_EQ(painted_a(1), ab_of_hex("#0000ff")->a);
}

TEST_F(KnownColorFiles, BadPalettesAreRefusedByTheirEntry) {
  const auto refused = [&](const std::string& palette, const std::string& hint = "1,2,a,jacket") {
    ColorizerOptions config;
    config.palette = palette;
    config.hints = hint;
    return refusal<UsageError>(config);
  };
  EXPECT_THAT(refused("jacket"), HasSubstr("--palette jacket: expected WORD=#rrggbb"));
  EXPECT_THAT(refused("#abc=#00ff00"), HasSubstr("expected WORD=#rrggbb"));
  EXPECT_THAT(refused("jacket=green"),
              HasSubstr("--palette jacket=green: expected a colour like #c08040, found green"));
  EXPECT_THAT(refused("jacket=#00ff00,jacket=#ff0000"), HasSubstr("jacket=#ff0000: jacket has a colour already"));
  EXPECT_THAT(refused("jacket=#00ff00,wall=#ff0000"), HasSubstr("no hint and no stroke is called wall"));
  EXPECT_THAT(refused("jacket=#00ff00,wall=#ff0000", "1,2,a,jaket"),
              HasSubstr("--palette (jacket, wall), found jaket"));
  EXPECT_THAT(refused(""), HasSubstr("--palette (none), found jacket"));
}

TEST_F(KnownColorFiles, BadEntriesAreRefusedByName) {
  const auto with = [](std::string ColorizerOptions::*option, const std::string& value) {
    ColorizerOptions config;
    config.*option = value;
    return config;
  };
  EXPECT_THAT(refusal<UsageError>(with(&ColorizerOptions::keyframes, "a")), HasSubstr("expected VIEW=FILE"));
  EXPECT_THAT(refusal<UsageError>(with(&ColorizerOptions::keyframes, "zebra=" + at("red.png"))), HasSubstr("zebra"));
  EXPECT_THAT(refusal<UsageError>(with(&ColorizerOptions::keyframes, "held=" + at("red.png"))), HasSubstr("held out"));
  EXPECT_THAT(refusal<InputError>(with(&ColorizerOptions::keyframes, "a=" + at("grey.png"))), HasSubstr("grey"));
  EXPECT_THAT(refusal<InputError>(with(&ColorizerOptions::keyframes, "a=" + at("square.png"))), HasSubstr("shape"));
  EXPECT_THAT(refusal<InputError>(with(&ColorizerOptions::hint_images, "a=" + at("red.png"))), HasSubstr("opaque"));
  EXPECT_THAT(refusal<MissingInputError>(with(&ColorizerOptions::keyframes, "a=" + at("none.png"))),
              HasSubstr("none.png"));
  EXPECT_THAT(refusal<UsageError>(with(&ColorizerOptions::hints, "1,2,a")), HasSubstr("x,y,VIEW,#rrggbb"));
  EXPECT_THAT(refusal<UsageError>(with(&ColorizerOptions::hints, "1,two,a,#ff0000")), HasSubstr("two"));
  EXPECT_THAT(refusal<UsageError>(with(&ColorizerOptions::hints, "1,2,a,red")), HasSubstr("red"));
  EXPECT_THAT(refusal<UsageError>(with(&ColorizerOptions::hints, "40,2,a,#ff0000")), HasSubstr("40 x 20"));
}

}  // namespace
}  // namespace cnerf::pipeline
