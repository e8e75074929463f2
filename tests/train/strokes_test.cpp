// Strokes: checks, rasters, and what they make known.

#include "src/train/chroma/strokes.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "src/base/error.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

using testing::HasSubstr;
const PaintableViews kViews = {{"a.png", "b.png"}, {"held"}};

/// None.
PaintedPictures& pictures() {
  static PaintedPictures none("nowhere");
  return none;
}

Stroke dot(const std::string& id, float x, float y, const std::string& color = "#ff0000") {
  Stroke stroke{.id = id, .view = "a.png", .color = color, .size = 0.2f};
  stroke.points = {{x, y, 1}};
  return stroke;
}

std::string text_of(const Stroke& stroke) {
  StrokeList list;
  list.strokes = {stroke};
  return json_of(list).dump();
}

TEST(Strokes, AreWrittenAndRead) {
  const test::TempDir folder;
  StrokeList list{7, {dot("k1", 0.5f, 0.25f), dot("k2", 0.1f, 0.2f)}};
  list.strokes[1].kind = "exact";
  list.strokes[1].hidden = true;
  list.strokes[1].softness = 0.5f;
  write_strokes(folder / "strokes.json", list);
  const StrokeList read = read_strokes(folder / "strokes.json", kViews);
  EXPECT_EQ(json_of(read).dump(), json_of(list).dump());
  EXPECT_EQ(read.revision, 7);
  EXPECT_TRUE(read.strokes[1].hidden);
}

TEST(Strokes, BadOnesAreRefusedByTheirField) {
  const auto refused = [&](const std::function<void(Stroke&)>& spoil) -> std::string {
    Stroke stroke = dot("k1", 0.5f, 0.5f);
    spoil(stroke);
    try {
      (void)strokes_of_json(text_of(stroke), "strokes.json", kViews, pictures());
    } catch (const InputError& problem) {
      return problem.what();
    }
    return "taken";
  };
  EXPECT_EQ(refused([](Stroke&) {}), "taken");
  EXPECT_THAT(refused([](Stroke& s) { s.view = "c.png"; }), HasSubstr("strokes[0].view"));
  EXPECT_THAT(refused([](Stroke& s) { s.id = "../x"; }), HasSubstr("strokes[0].id"));
  EXPECT_THAT(refused([](Stroke& s) { s.kind = "burn"; }), HasSubstr("strokes[0].kind"));
  EXPECT_THAT(refused([](Stroke& s) { s.color = "red"; }), HasSubstr("strokes[0].color"));
  EXPECT_THAT(refused([](Stroke& s) { s.color = "#12345g"; }), HasSubstr("strokes[0].color"));
  EXPECT_EQ(refused([](Stroke& s) { s.word = "the jacket"; }), "taken");
  EXPECT_THAT(refused([](Stroke& s) { s.word = "a=b"; }), HasSubstr("strokes[0].word"));
  EXPECT_THAT(refused([](Stroke& s) { s.word = std::string(65, 'a'); }), HasSubstr("strokes[0].word"));
  EXPECT_THAT(refused([](Stroke& s) {
                for (int letter = 0; letter < 33; ++letter) s.word += "ж";
              }),
              HasSubstr("at most 64 bytes"));
  EXPECT_THAT(refused([](Stroke& s) { s.size = 0.9f; }), HasSubstr("strokes[0].size"));
  EXPECT_THAT(refused([](Stroke& s) { s.reach = 9; }), HasSubstr("strokes[0].reach"));
  EXPECT_THAT(refused([](Stroke& s) { s.points.clear(); }), HasSubstr("strokes[0].points"));
  EXPECT_THAT(refused([](Stroke& s) { s.points[0][0] = 5; }), HasSubstr("strokes[0].points"));
  EXPECT_THAT(refused([](Stroke& s) { s.points.assign(kMostStrokePoints + 1, {0, 0, 1}); }), HasSubstr("points"));
}

Viewpoint viewpoint(const std::string& name) {
  return {name, {{1, 2, 1.0 / 3}, {{{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}}, {64, 48, 50, 51, 32, 24}}};
}

TEST(Strokes, ViewpointsAreWrittenAndRead) {
  const test::TempDir folder;
  StrokeList list{7, {dot("k1", 0.5f, 0.25f), dot("k2", 0.1f, 0.2f)}, {viewpoint("viewpoint-1"), viewpoint("other")}};
  list.strokes[1].view = "viewpoint-1";
  write_strokes(folder / "strokes.json", list);
  const StrokeList read = read_strokes(folder / "strokes.json", kViews);
  EXPECT_EQ(json_of(read).dump(), json_of(list).dump());
  ASSERT_EQ(read.viewpoints, list.viewpoints) << "to the last bit";
  ASSERT_EQ(painted_viewpoints(read).size(), 1u);
  EXPECT_EQ(painted_viewpoints(read)[0].name, "viewpoint-1");
  EXPECT_EQ(read.viewpoints[0].camera.world_from_camera().linear * (Vec3d{0, 0, 1}), (Vec3d{0, -1, 0})) << "rows";
}

TEST(Strokes, ThatColorEverythingAreWrittenReadAndRefusedByName) {
  const test::TempDir folder;
  StrokeList list{7, {dot("k1", 0.5f, 0.25f)}};
  EXPECT_EQ(json_of(list).dump().find("everywhere"), std::string::npos) << "as files were before";
  list.everywhere = true;
  write_strokes(folder / "strokes.json", list);
  EXPECT_TRUE(read_strokes(folder / "strokes.json", kViews).everywhere);
  const std::vector<Intrinsics> lenses(kViews.names.size(), {LensModel::kPinhole, 20, 20, 20, 20, 10, 10, {}});
  EXPECT_TRUE(painted(list, kViews.names, lenses).at(0).everywhere);
  try {
    (void)strokes_of_json("{\"strokes\": [], \"everywhere\": 3}", "strokes.json", kViews, pictures());
    FAIL() << "taken";
  } catch (const InputError& problem) {
    EXPECT_THAT(problem.what(), HasSubstr("strokes.json: everywhere: "));
  }
}

TEST(Strokes, BadViewpointsAreRefusedByTheirField) {
  const auto refused = [&](const std::function<void(std::vector<Viewpoint>&)>& spoil) -> std::string {
    StrokeList list{0, {}, {viewpoint("viewpoint-1"), viewpoint("viewpoint-2"), viewpoint("viewpoint-3")}};
    spoil(list.viewpoints);
    try {
      (void)strokes_of_json(json_of(list).dump(), "strokes.json", kViews, pictures());
    } catch (const InputError& problem) {
      return problem.what();
    }
    return "taken";
  };
  using List = std::vector<Viewpoint>&;
  EXPECT_EQ(refused([](List) {}), "taken");
  for (const char* name : {"", "a.png", "../x", "a b", "viewpoint_1", "viewpoint-2", "held"}) {
    EXPECT_THAT(refused([&](List v) { v[0].name = name; }), HasSubstr("].name")) << name;
  }
  EXPECT_THAT(refused([](List v) { v[2].name.assign(41, 'x'); }), HasSubstr("viewpoints[2].name"));
  EXPECT_THAT(refused([](List v) { v[2].camera.lens.fx = 0; }), HasSubstr("viewpoints[2].focal length"));
  EXPECT_THAT(refused([](List v) { v[0].camera.lens.fy = 1e9; }), HasSubstr("viewpoints[0].focal length"));
  EXPECT_THAT(refused([](List v) { v[0].camera.lens.cy = -1e9; }), HasSubstr("viewpoints[0].principal point"));
  EXPECT_THAT(refused([](List v) { v[0].camera.lens.width = 2049; }), HasSubstr("viewpoints[0].lens.width"));
  EXPECT_THAT(refused([](List v) { v[0].camera.lens.height = 0; }), HasSubstr("viewpoints[0].lens.height"));
  EXPECT_THAT(refused([](List v) { v[1].camera.position[2] = 1e30; }), HasSubstr("viewpoints[1].position"));
  EXPECT_THAT(refused([](List v) { v[1].camera.rotation[0][0] = -1; }), HasSubstr("viewpoints[1].rotation"));
  EXPECT_THAT(refused([](List v) { v[1].camera.rotation = {}; }), HasSubstr("viewpoints[1].rotation"));
  EXPECT_THAT(refused([](List v) {
                for (int i = 0; i < 50; ++i) v.push_back(viewpoint("v" + std::to_string(i)));
              }),
              HasSubstr("viewpoints: "));
}

TEST(Strokes, ListsOfAnyContentAreRefusedOrRead) {
  for (const char* text : {"", "[]", "{}", "null", "{\"strokes\": 3}", "{\"strokes\": [{}]}", "{\"strokes\": [3]}",
                           "{\"revision\": \"x\", \"strokes\": []}", "{\"strokes\": [], \"viewpoints\": 3}",
                           "{\"strokes\": [], \"viewpoints\": [{\"name\": \"a\"}]}"}) {
    EXPECT_THROW((void)strokes_of_json(text, "strokes.json", kViews, pictures()), InputError) << text;
  }
  EXPECT_THROW((void)strokes_of_json(std::string(kLargestStrokeFile + 1, ' '), "strokes.json", kViews, pictures()),
               InputError);
  StrokeList twice{0, {dot("k1", 0, 0), dot("k1", 0, 0)}};
  EXPECT_THROW((void)strokes_of_json(json_of(twice).dump(), "strokes.json", kViews, pictures()), InputError);
  const StrokeList old = strokes_of_json("{\"strokes\": []}", "strokes.json", kViews, pictures());
  EXPECT_TRUE(old.strokes.empty());
  EXPECT_TRUE(old.viewpoints.empty()) << "files of earlier versions have none";
  EXPECT_FALSE(old.everywhere);
}

TEST(Strokes, AreWrittenInNoMoreThanWhatTheyWereSentIn) {
  std::string text = R"({"revision":0,"strokes":[{"id":"k1","view":"a.png","kind":"paint","size":0.02,"points":[)";
  for (int i = 0; i < 1000; ++i) {
    text += fmt::format("{}[{:.5g},{:.5g},{:.3g}]", i == 0 ? "" : ",", 0.1 + 0.00073 * i, 0.9 - 0.00031 * i, 0.001 * i);
  }
  text += R"(]}],"viewpoints":[]})";
  const StrokeList list = strokes_of_json(text, "strokes.json", kViews, pictures());
  EXPECT_LE(json_of(list).dump().size(), text.size() + 80);
}

TEST(Strokes, ThatCouldNotBeReadAgainAreNotWritten) {
  const test::TempDir folder;
  write_strokes(folder / "strokes.json", {3, {dot("k1", 0.5f, 0.5f)}});
  StrokeList large{4, {}};
  for (int i = 0; i < 50; ++i) {
    large.strokes.push_back(dot("k" + std::to_string(i), 0.5f, 0.5f));
    large.strokes.back().points.assign(kMostStrokePoints, {0.123456789f, 0.987654321f, 0.333333333f});
  }
  EXPECT_THROW(write_strokes(folder / "strokes.json", large), InputError);
  EXPECT_EQ(read_strokes(folder / "strokes.json", kViews).revision, 3);
}

TEST(Strokes, ADotCoversADiscOfItsSizeAndPressure) {
  constexpr int kSide = 100;
  const auto area = [&](float pressure, float softness) {
    Stroke stroke = dot("k1", 0.5f, 0.5f);
    stroke.points[0][2] = pressure;
    stroke.softness = softness;
    std::vector<float> coverage(kSide * kSide);
    cover(stroke, kSide, kSide, coverage);
    double sum = 0;
    for (const float value : coverage) sum += value;
    return sum;
  };
  EXPECT_NEAR(area(1, 0), M_PI * 10 * 10, 4) << "a fifth of 100 pixels across";
  EXPECT_NEAR(area(0.5f, 0), M_PI * 5 * 5, 3);
  EXPECT_LT(area(1, 1), 0.5 * area(1, 0)) << "a cone holds a third of its cylinder";
}

TEST(Strokes, ALineCoversWhatLiesWithinItsRadius) {
  constexpr int width = 80, height = 60;
  Stroke stroke = dot("k1", 0.25f, 0.5f);
  stroke.points.push_back({0.75f, 0.5f, 1});
  std::vector<float> coverage(width * height);
  cover(stroke, width, height, coverage);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double dx = std::max({20 - (x + 0.5), (x + 0.5) - 60, 0.0}), dy = y + 0.5 - 30;
      const double distance = std::hypot(dx, dy), radius = 0.1 * height;
      const float value = coverage[std::size_t(y * width + x)];
      EXPECT_TRUE(distance > radius - 1 || value == 1) << x << ' ' << y;
      EXPECT_TRUE(distance < radius + 1 || value == 0) << x << ' ' << y;
    }
  }
}

TEST(Strokes, LaterOnesLieAboveAndAnEraserTakesAwayWhatIsBelow) {
  std::vector<Stroke> strokes = {dot("k1", 0.5f, 0.5f), dot("k2", 0.5f, 0.5f, "#0000ff")};
  strokes[1].size = 0.1f;
  strokes.push_back(dot("k3", 0.9f, 0.5f, "#00ff00"));
  strokes.push_back(dot("k4", 0.9f, 0.5f));
  strokes[3].kind = "erase";
  const KnownColors paint = painted_on("a.png", strokes, 100, 100);
  const auto at = [](int x, int y) { return std::size_t(y * 100 + x); };
  EXPECT_GT(paint.ab[at(50, 50)].b, -200);
  EXPECT_LT(paint.ab[at(50, 50)].b, -50) << "blue";
  EXPECT_GT(paint.ab[at(58, 50)].a, 50) << "red around it";
  EXPECT_EQ(paint.is_known[at(90, 50)], 0);
  strokes[3].hidden = true;
  EXPECT_EQ(painted_on("a.png", strokes, 100, 100).is_known[at(90, 50)], 1);
}

TEST(Strokes, GreyHasNoColorAndExactStaysWhereItIs) {
  std::vector<Stroke> strokes = {dot("k1", 0.2f, 0.5f), dot("k2", 0.8f, 0.5f)};
  strokes[0].kind = "grey";
  strokes[1].kind = "exact";
  const KnownColors paint = painted_on("a.png", strokes, 50, 50);
  EXPECT_EQ(paint.ab[25 * 50 + 10].a, 0);
  EXPECT_EQ(paint.is_known[25 * 50 + 10], 1);
  EXPECT_EQ(paint.reach[25 * 50 + 10], 1);
  EXPECT_EQ(paint.reach[25 * 50 + 40], 0);
}

TEST(Strokes, OnlyViewsThatArePaintedAreKnown) {
  const Intrinsics lens{LensModel::kPinhole, 40, 30, 50, 50, 20, 15, {}};
  std::vector<Stroke> strokes = {dot("k1", 0.5f, 0.5f)};
  const std::vector<Intrinsics> lenses = {lens, lens};
  ASSERT_EQ(painted({0, strokes}, kViews.names, lenses).size(), 1u);
  EXPECT_EQ(painted({0, strokes}, kViews.names, lenses)[0].view, "a.png");
  strokes[0].hidden = true;
  EXPECT_TRUE(painted({0, strokes}, kViews.names, lenses).empty());
}

}  // namespace
}  // namespace cnerf
