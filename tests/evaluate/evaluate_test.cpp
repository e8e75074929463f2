#include "src/evaluate/evaluate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "src/base/check.h"
#include "src/base/json_record.h"
#include "src/color/colorspace_math.h"
#include "src/picture/encode.h"
#include "tests/evaluate/painted_scene.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

using test::PaintedScene;

constexpr int kWidth = 16, kHeight = 12;

/// Views of sRGB value 51 (0.2); no image files, hence no colour truth unless `measure` is given one.
Capture grey_capture(int views, int held_out) {
  Capture capture;
  for (int i = 0; i < views; ++i) {
    View view;
    view.name = "view" + std::to_string(i);
    view.intrinsics.width = view.image.width = kWidth;
    view.intrinsics.height = view.image.height = kHeight;
    view.image.u8.assign(kWidth * kHeight, 51);
    view.held_out = i < held_out;
    capture.views.push_back(view);
  }
  return capture;
}

TEST(Evaluate, HeldOutViewsWinElseSomeTrainingViewsAreTaken) {
  EXPECT_EQ(views_to_evaluate(grey_capture(20, 3), {}).size(), 3u);
  const Capture all_trained = grey_capture(20, 0);
  const auto some = views_to_evaluate(all_trained, {});
  EXPECT_EQ(some.size(), 8u);
  EXPECT_EQ(some.front(), &all_trained.views.front());
  EXPECT_EQ(views_to_evaluate(grey_capture(3, 0), {}).size(), 3u);
}

TEST(Evaluate, AGreySceneHasNumbersOfLuminanceOnly) {
  const Capture capture = grey_capture(2, 1);
  const RenderedImage ours =
      PaintedScene(linear_from_srgb(0.3f), false).render(capture.views[0].intrinsics, {}, {.color = false});
  const ViewMetrics metrics = measure({capture.views[0], ours, std::nullopt});
  EXPECT_NEAR(metrics.psnr_luminance.value(), 20.0, 1e-4) << "0.3 against 0.2";
  EXPECT_FALSE(metrics.colorfulness.has_value());
  EXPECT_FALSE(metrics.ab_error.has_value());
}

TEST(Evaluate, TheExposureThatFitsIsANumberOfItsOwn) {
  Capture capture = grey_capture(2, 1);
  const RenderedImage ours =
      PaintedScene(linear_from_srgb(0.3f), false).render(capture.views[0].intrinsics, {}, {.color = false});
  const ViewMetrics flat = measure({capture.views[0], ours, std::nullopt});
  EXPECT_LT(flat.psnr_luminance.value(), 21);
  EXPECT_GT(flat.psnr_luminance_exposure_fitted.value(), 60) << "one grey is another at another exposure";
  for (std::size_t p = 0; p < capture.views[0].image.u8.size(); p += 2) capture.views[0].image.u8[p] = 102;
  const ViewMetrics striped = measure({capture.views[0], ours, std::nullopt});
  EXPECT_LT(striped.psnr_luminance_exposure_fitted.value(), 25) << "but no gain makes stripes of it";
}

TEST(Evaluate, AColouredSceneIsComparedWithTruthAndBake) {
  const Capture capture = grey_capture(2, 1);
  const float y = linear_from_srgb(0.2f);
  const RenderedImage ours =
      PaintedScene(y, true).render(capture.views[0].intrinsics, {}, {.color = true, .baked_color = true});
  const std::optional<ColorImage> truth = ColorImage{kWidth, kHeight, ours.rgb};
  const ViewMetrics metrics = measure({capture.views[0], ours, truth});
  EXPECT_NEAR(metrics.psnr_rgb.value(), 100, 1e-9);
  EXPECT_NEAR(metrics.ab_error.value(), 0, 1e-9);
  EXPECT_GT(metrics.ab_error_grey.value(), 20) << "red is far from grey";
  EXPECT_NEAR(metrics.bake_ab_distance.value(), metrics.ab_error_grey.value(), 1e-3) << "the bake is grey";
  EXPECT_NEAR(metrics.colorfulness_difference.value(), 0, 1e-9);
}

TEST(Evaluate, FeaturesOfAllViewsMakeOneDistance) {
  /// The mean of each channel, in each region alike but for a little that tells regions apart.
  struct Means final : PictureEncoder {
    [[nodiscard]] std::vector<float> regions(std::span<const std::uint8_t> rgb, int width, int height) const override {
      std::vector<float> all;
      for (int region = 0; region < kRegions * kRegions; ++region) {
        for (std::size_t c = 0; c < 3; ++c) all.push_back(float(rgb[c]) + float(region % 2));
      }
      EXPECT_EQ(rgb.size(), std::size_t(width) * std::size_t(height) * 3);
      return all;
    }
  };
  const PaintedScene scene(linear_from_srgb(0.3f), true);
  const test::TempDir folder;
  Capture capture = grey_capture(3, 2);
  for (View& view : capture.views) {
    view.image_file = folder / (view.name + ".png");
    Picture truth{kWidth, kHeight, {}};
    for (int i = 0; i < kWidth * kHeight; ++i) truth.rgb.insert(truth.rgb.end(), {90, 140, 60});
    write_png(view.image_file, truth);
  }
  const Means encoder;
  EvaluateOptions options;
  EXPECT_FALSE(evaluate(scene, capture, options).feature_distance);
  options.encoder = &encoder;
  const Metrics measured = evaluate(scene, capture, options);
  ASSERT_TRUE(measured.feature_distance);
  EXPECT_GT(*measured.feature_distance, 100) << "it is painted red";

  Metrics metrics;
  for (const int view : {0, 1}) {
    ViewMetrics one;
    one.features_ours = encoder.regions(std::vector<std::uint8_t>{10, 20, 30}, 1, 1);
    one.features_truth = encoder.regions(std::vector<std::uint8_t>{13, 20, 26}, 1, 1);
    one.view = std::to_string(view);
    metrics.views.push_back(one);
  }
  summarise(metrics);
  ASSERT_TRUE(metrics.feature_distance);
  EXPECT_NEAR(*metrics.feature_distance, 9 + 16, 1e-6) << "the means differ alone";
  EXPECT_TRUE(metrics.views[0].features_ours.empty());
  EXPECT_EQ(record_of<Metrics>(nlohmann::ordered_json::parse(json_of(metrics).dump()), "m").feature_distance,
            metrics.feature_distance);
}

TEST(Evaluate, NetworksSeeTheTruthWhereMasksAre) {
  struct Keeping final : PictureEncoder {
    [[nodiscard]] std::vector<float> regions(std::span<const std::uint8_t> rgb, int /*width*/,
                                             int /*height*/) const override {
      seen.emplace_back(rgb.begin(), rgb.end());
      return {};
    }
    mutable std::vector<std::vector<std::uint8_t>> seen;
  };
  const test::TempDir folder;
  Capture capture = grey_capture(1, 1);
  View& view = capture.views[0];
  view.image_file = folder / "view.png";
  Picture photograph{kWidth, kHeight, {}};
  for (int i = 0; i < kWidth * kHeight; ++i) photograph.rgb.insert(photograph.rgb.end(), {90, 140, 60});
  write_png(view.image_file, photograph);
  view.image.mask.assign(view.image.pixel_count(), 0);
  view.image.mask[1] = 1;
  const Keeping encoder;
  EvaluateOptions options;
  options.encoder = &encoder;
  (void)evaluate_views(PaintedScene(linear_from_srgb(0.3f), true), std::vector<const View*>{&view}, options);
  ASSERT_EQ(encoder.seen.size(), 2u) << "ours and the truth";
  const auto &ours = encoder.seen[0], &truth = encoder.seen[1];
  for (std::size_t i = 0; i < truth.size(); ++i) EXPECT_EQ(ours[i] == truth[i], i / 3 != 1) << i;
  view.image.mask[1] = 0;
  (void)evaluate_views(PaintedScene(linear_from_srgb(0.3f), true), std::vector<const View*>{&view}, options);
  EXPECT_EQ(encoder.seen.size(), 2u) << "where all is masked, there is nothing to be alike";
}

TEST(Evaluate, MaskedPixelsDoNotCount) {
  Capture capture = grey_capture(2, 1);
  View& view = capture.views[0];
  view.image.mask.assign(view.image.pixel_count(), 255);
  view.image.mask[0] = 0;
  view.image.u8[0] = 255;
  const RenderedImage ours = PaintedScene(linear_from_srgb(0.2f), false).render(view.intrinsics, {}, {.color = false});
  EXPECT_GT(measure({view, ours, std::nullopt}).psnr_luminance.value(), 90);
  view.image.mask[0] = 1;
  EXPECT_LT(measure({view, ours, std::nullopt}).psnr_luminance.value(), 30);
}

TEST(Evaluate, PicturesOfAnotherSizeAreRefused) {
  const Capture capture = grey_capture(2, 1);
  Intrinsics other = capture.views[0].intrinsics;
  other.width += 1;
  const RenderedImage ours = PaintedScene(0.5f, false).render(other, {}, {});
  EXPECT_THROW((void)measure({capture.views[0], ours, std::nullopt}), ContractError);
}

TEST(Evaluate, AMeanDoesNotHideTheWorstView) {
  std::vector<ViewMetrics> views(11);
  for (std::size_t i = 0; i < views.size(); ++i) {
    views[i].view = "view" + std::to_string(i);
    views[i].psnr_luminance = 20 + double(i);
    views[i].near_opacity = 0.01 * double(i);
    views[i].colorfulness = 5;
  }
  views[4].psnr_luminance = 12;
  const auto spread = spread_of(views);
  EXPECT_EQ(spread.at("psnr_luminance").worst_view, "view4");
  EXPECT_EQ(spread.at("psnr_luminance").worst, 12);
  EXPECT_EQ(spread.at("psnr_luminance").tenth, 20) << "the second of eleven";
  EXPECT_EQ(spread.at("psnr_luminance").median, 25);
  EXPECT_EQ(spread.at("near_opacity").worst_view, "view10") << "the more, the worse";
  EXPECT_NEAR(spread.at("near_opacity").tenth, 0.09, 1e-12);
  EXPECT_FALSE(spread.contains("psnr_luminance_aligned")) << "was not measured";
  EXPECT_FALSE(spread.contains("colourfulness")) << "neither end is the worst";
}

TEST(Evaluate, JsonHoldsWhatWasMeasuredAndNothingElse) {
  Metrics metrics;
  metrics.split = "held-out";
  metrics.mean.psnr_luminance = 26.5;
  ViewMetrics view;
  view.view = "a.png";
  view.psnr_luminance = 26.5;
  view.ssim = 0.75;
  metrics.views.push_back(view);
  const auto json = json_of(metrics);
  EXPECT_EQ(json.at("schema_version"), kMetricsSchemaVersion);
  EXPECT_EQ(json.at("mean").at("psnr_luminance"), 26.5);
  EXPECT_FALSE(json.at("mean").contains("psnr_rgb"));
  EXPECT_FALSE(json.contains("spread"));
  EXPECT_EQ(json.at("views").at(0).at("view"), "a.png");
  EXPECT_EQ(json.at("views").at(0).at("ssim"), 0.75);
}

}  // namespace
}  // namespace cnerf
