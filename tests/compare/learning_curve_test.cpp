// Learning curves: what is read off them, and that measuring costs no training time.

#include "src/compare/learning_curve.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <thread>

#include "src/base/error.h"
#include "src/color/colorspace_math.h"
#include "src/picture/encode.h"
#include "tests/evaluate/analytic_engine.h"
#include "tests/support/data.h"
#include "tests/support/toy_capture.h"

namespace cnerf::compare {
namespace {

const std::vector<LearningPoint> kRising = {{1, 10}, {2, 20}, {4, 24}};

TEST(LearningCurve, TimeToAValueLiesBetweenItsPoints) {
  EXPECT_DOUBLE_EQ(seconds_to(kRising, 15, 1).value(), 1.5);
  EXPECT_DOUBLE_EQ(seconds_to(kRising, 22, 1).value(), 3);
  EXPECT_DOUBLE_EQ(seconds_to(kRising, 5, 1).value(), 1) << "it was there from the beginning";
  EXPECT_FALSE(seconds_to(kRising, 24.1, 1));
  const std::vector<LearningPoint> falling = {{1, 30}, {3, 10}};
  EXPECT_DOUBLE_EQ(seconds_to(falling, 20, -1).value(), 2);
  EXPECT_FALSE(seconds_to(falling, 9, -1));
  EXPECT_FALSE(seconds_to({}, 1, 1));
}

TEST(LearningCurve, ValueAtATime) {
  EXPECT_DOUBLE_EQ(value_at(kRising, 3), 22);
  EXPECT_DOUBLE_EQ(value_at(kRising, 0.1), 10);
  EXPECT_DOUBLE_EQ(value_at(kRising, 9), 24);
}

TEST(LearningCurve, MeasuringAndWhatComesBeforeAreNoTraining) {
  using namespace std::chrono_literals;
  int measured = 0;
  struct Counting final : Observer {
    int reports = 0;
    void report_progress(const Progress& /*progress*/) override { ++reports; }
  } counting;
  LearningCurve curve("train", counting, [&] {
    std::this_thread::sleep_for(60ms);
    return double(++measured);
  });
  const ProgressSink sink = curve.progress_sink();
  sink({"cache", 0.5, {}});
  std::this_thread::sleep_for(120ms);
  sink({"cache", 1, {}});
  for (int step = 0; step < 40; ++step) {
    std::this_thread::sleep_for(5ms);
    sink({"train", step / 40.0, {}});
  }
  const double whole = curve.seconds();
  EXPECT_EQ(counting.reports, 42);
  ASSERT_GE(curve.points().size(), 3u);
  EXPECT_LT(curve.points().size(), 20u) << "not at every step";
  EXPECT_LT(curve.points().front().seconds, 0.1) << "the caching counted";
  EXPECT_GE(whole, 0.19) << "39 pauses of 5 ms and more";
  for (std::size_t i = 1; i < curve.points().size(); ++i) {
    EXPECT_GT(curve.points()[i].seconds, curve.points()[i - 1].seconds);
  }
  // On a busy machine sleeps are longer, but measuring them 60 ms each would show: without the pauses the last point
  // would lie as far behind as all of them took.
  EXPECT_LT(whole, 0.2 + 0.03 * measured + 1.0);
}

TEST(LearningCurve, PassesOnWhatTrainingSays) {
  struct Keeping final : Observer {
    void say(const std::string& text) override { said = text; }
    void wrote(const std::string& what, const std::filesystem::path& path) override { written = what + path.string(); }
    std::string said, written;
  } keeping;
  LearningCurve curve("train", keeping, [] { return 0.0; });
  curve.say("a note");
  curve.wrote("gallery ", "a.png");
  EXPECT_EQ(keeping.said, "a note");
  EXPECT_EQ(keeping.written, "gallery a.png");
}

using Rgb8 = std::array<std::uint8_t, 3>;

constexpr Rgb8 kBrick = {150, 120, 110}, kGrey = {130, 130, 130};

Vec3f light_of(const Rgb8& color) {
  const auto channel = [&](std::size_t c) { return linear_from_srgb(float(color[c]) / 255); };
  return {channel(0), channel(1), channel(2)};
}
Ab ab_of_brick() {
  const Lab<float> lab = lab_from_linear_rgb(light_of(kBrick));
  return {lab.a, lab.b};
}

/// A toy's views, each of one colour.
class PlainViews {
 public:
  explicit PlainViews(const std::vector<Rgb8>& colors) : capture_(test::toy_capture(int(colors.size()))) {
    for (std::size_t v = 0; v < colors.size(); ++v) {
      View& view = capture_.views[v];
      Picture photograph{view.image.width, view.image.height, {}};
      for (std::size_t p = 0; p < view.image.pixel_count(); ++p) {
        photograph.rgb.insert(photograph.rgb.end(), colors[v].begin(), colors[v].end());
      }
      view.image_file = folder_ / ("photographs/" + view.name + ".png");
      write_png(view.image_file, photograph);
      std::ranges::fill(view.image.u8, colors[v][0]);
      views_.push_back(&view);
    }
  }
  [[nodiscard]] HeldOutPixels pixels() const { return HeldOutPixels(views_, SceneFrame(), 100); }

 private:
  test::TempDir folder_;
  Capture capture_;
  std::vector<const View*> views_;
};

/// Sees the photographs' light along every other ray, and nothing along the rays between.
class EveryOtherRay final : public test::AnalyticEngine {
 public:
  explicit EveryOtherRay(float light) : light_(light) {}
  void render(std::span<const Ray> rays, const MarchSettings&, const RenderEffort&,
              std::span<RayResult> results) const override {
    for (std::size_t r = 0; r < rays.size(); ++r) results[r] = r % 2 == 0 ? RayResult{light_, 1, 1} : RayResult{};
  }
  void trace(std::span<const Ray> rays, const MarchSettings&, const RenderEffort&, std::vector<WeightedSample>& samples,
             std::vector<std::size_t>& offsets) const override {
    samples.clear();
    offsets = {0};
    for (std::size_t r = 0; r < rays.size(); ++r) {
      if (r % 2 == 0) samples.push_back({1, 1, light_});
      offsets.push_back(samples.size());
    }
  }

 private:
  float light_;
};

/// Answers one colour.
class OneColor final : public ColorBinEngine {
 public:
  explicit OneColor(Ab color) : color_(color) {}
  void logits(const PixelSamples&, std::span<float>) const override {}
  void decode(const PixelSamples&, float, std::span<Ab> colors) const override { std::ranges::fill(colors, color_); }
  [[nodiscard]] std::vector<StatePiece> state() override { return {}; }
  void state_loaded() override {}

 private:
  double fit(const PixelSamples&, std::span<const SoftLabel>, std::span<const float>, const ChromaLossWeights&,
             float) override {
    return 0;
  }

  Ab color_;
};

TEST(HeldOutPixels, SeeTheSkyBehindTheField) {
  const PlainViews views({kGrey, kGrey});
  const float light = luminance_of(light_of(kGrey));
  const DirectionMap sky{2, 1, {std::vector<float>(2, light)}};
  const EveryOtherRay engine(light);
  EXPECT_GT(views.pixels().psnr(engine, {}, sky.plane(0)), 60);
  EXPECT_LT(views.pixels().psnr(engine, {}), 10) << "over black: half of the pixels are 0.5 off";
}

TEST(HeldOutPixels, ColoursAreTheFieldsOnlyWhereItIsSeen) {
  const Ab brick = ab_of_brick();
  const double chroma = std::hypot(double(brick.a), double(brick.b));
  ASSERT_GT(chroma, 5);
  const PlainViews views({kBrick, kBrick});
  const float light = luminance_of(light_of(kBrick));
  const DirectionMap sky{2, 1, {std::vector<float>(2, light)}};
  const EveryOtherRay engine(light);
  HeldOutPixels pixels = views.pixels();
  pixels.trace(engine, {});
  EXPECT_NEAR(pixels.ab_error(OneColor(brick), 0.38f), chroma / 2, 0.05) << "nothing counts as grey";
  pixels.trace(engine, {}, sky.plane(0));
  EXPECT_LT(pixels.ab_error(OneColor(brick), 0.38f), 0.05) << "nothing before a sky is the sky's";
}

TEST(HeldOutPixels, AreComparedWhereTheirColoursAreKnown) {
  const Ab brick = ab_of_brick();
  const EveryOtherRay engine(luminance_of(light_of(kBrick)));
  const auto error_on = [&](const std::vector<Rgb8>& colors) {
    const PlainViews views(colors);
    HeldOutPixels pixels = views.pixels();
    pixels.trace(engine, {});
    return pixels.ab_error(OneColor(brick), 0.38f);
  };
  EXPECT_NEAR(error_on({kBrick, kGrey}), error_on({kBrick, kBrick}), 1e-6);
  EXPECT_THROW((void)error_on({kGrey}), InputError);
}

}  // namespace
}  // namespace cnerf::compare
