/// Which captures have a sky, and which of their pixels show it.

#include "src/train/luminance/seen_sky.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "src/base/error.h"
#include "src/base/rng.h"
#include "src/engine/engines.h"
#include "src/train/luminance/luminance_model.h"
#include "tests/support/data.h"
#include "tests/support/toy_capture.h"

namespace cnerf {
namespace {

constexpr int kWidth = 160, kHeight = 120;

/// What a view shows in a direction, encoded 0..255.
using Shown = double (*)(Vec3d direction, int view, double noise);

/// Cameras on a circle that look outwards over an uneven ground.
Capture outdoors(Shown shown, int views = 6) {
  Capture capture;
  for (int v = 0; v < views; ++v) {
    View view;
    view.name = "view" + std::to_string(v);
    view.intrinsics = {LensModel::kPinhole, kWidth, kHeight, 140, 140, 80, 60, {}};
    const double angle = 2 * std::numbers::pi * v / views;
    const Vec3d outward = {std::cos(angle), std::sin(angle), 0};
    view.world_from_camera = test::look_at(outward, outward * 2.0 + Vec3d{0, 0, 0.1});
    view.image.width = kWidth;
    view.image.height = kHeight;
    const CounterRng rng(7, std::uint64_t(v));
    for (int p = 0; p < kWidth * kHeight; ++p) {
      const Vec3d direction = normalized(view.world_from_camera.direction(
          ray_direction(view.intrinsics, {p % kWidth + 0.5, double(p / kWidth) + 0.5})));
      const double noise = 2 * double(rng.uniform(std::uint64_t(p))) - 1;
      view.image.u8.push_back(std::uint8_t(std::clamp(shown(direction, v, noise), 0.0, 255.0)));
    }
    capture.views.push_back(std::move(view));
  }
  return capture;
}

double bright_sky(Vec3d direction, int, double noise) {
  if (direction.z < 0) return 90 + 60 * noise;
  return 235 - 40 * direction.z + 10 * direction.x + noise;
}

SeenSky found_in(const Capture& capture, const std::vector<SparsePoint>& points = {}) {
  const std::vector<TrainingView> views = training_views(capture, {});
  return find_sky(capture, views, points);
}

TEST(SeenSky, IsWhatIsBrightAboveTheHorizon) {
  const Capture capture = outdoors(bright_sky);
  const SeenSky sky = found_in(capture);
  ASSERT_TRUE(sky.light.exists());
  std::size_t wrong = 0, found = 0, above = 0;
  const std::vector<TrainingView> views = training_views(capture, {});
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::size_t p = 0; p < sky.labels[v].size(); ++p) {
      const bool is_above = views[v].camera.ray_of_pixel(p).direction.z > 0;
      const bool is_sky = sky.labels[v][p] == SkyLabel::kSky;
      above += is_above ? 1 : 0;
      found += is_sky ? 1 : 0;
      wrong += is_sky && !is_above ? 1 : 0;
    }
  }
  EXPECT_EQ(wrong, 0u);
  EXPECT_GT(double(found), 0.9 * double(above));
  const Vec3f direction = normalized(Vec3f{1, 0.2f, 0.2f});
  const float truth = decode_transfer(Transfer::kSrgb, float(bright_sky(direction.cast<double>(), 0, 0) / 255));
  EXPECT_NEAR(sky.light.plane(0).along(direction), truth, 0.01f);
}

TEST(SeenSky, AnExposurePerViewIsNoReasonAgainstIt) {
  const Capture capture = outdoors([](Vec3d direction, int view, double noise) {
    return bright_sky(direction, view, noise) * (0.85 + 0.05 * (view % 4));
  });
  EXPECT_TRUE(found_in(capture).light.exists());
}

TEST(SeenSky, EdgesMayShowEither) {
  const SeenSky sky = found_in(outdoors(bright_sky));
  for (const std::vector<SkyLabel>& labels : sky.labels) {
    for (std::size_t p = std::size_t(kWidth); p < labels.size(); ++p) {
      const SkyLabel above = labels[p - std::size_t(kWidth)], here = labels[p];
      EXPECT_FALSE(above == SkyLabel::kSky && here == SkyLabel::kScene) << p;
    }
  }
}

TEST(SeenSky, IsNotABrightWallWithStructure) {
  const auto wall = [](Vec3d direction, int, double noise) {
    return direction.z < 0 ? 90 + 60 * noise : 215 + 40 * noise;
  };
  EXPECT_FALSE(found_in(outdoors(wall)).light.exists());
}

TEST(SeenSky, IsNotADarkCeiling) {
  const auto ceiling = [](Vec3d direction, int, double noise) {
    return direction.z < 0 ? 150 + 60 * noise : 60 + noise;
  };
  EXPECT_FALSE(found_in(outdoors(ceiling)).light.exists());
}

TEST(SeenSky, IsNotABrightFloor) {
  const auto floor = [](Vec3d direction, int, double noise) { return direction.z > 0 ? 90 + 60 * noise : 230 + noise; };
  EXPECT_FALSE(found_in(outdoors(floor)).light.exists());
}

/// Walls that are smooth, and look otherwise from each place, are near.
TEST(SeenSky, LooksAlikeFromAllViews) {
  const auto walls = [](Vec3d direction, int view, double noise) {
    if (direction.z < 0) return 90 + 60 * noise;
    const double slope = view % 2 == 0 ? 1 : -1;  // across the picture
    const double angle = std::atan2(direction.y, direction.x) - 2 * std::numbers::pi * view / 12;
    return 190 + slope * 100 * std::sin(angle) + noise;
  };
  EXPECT_FALSE(found_in(outdoors(walls, 12)).light.exists());
}

TEST(SeenSky, HasNoSparsePoints) {
  const Capture capture = outdoors(bright_sky);
  std::vector<SparsePoint> points;
  for (std::uint32_t v = 0; v < 6; ++v) {
    const View& view = capture.views[v];
    for (int i = 0; i < 200; ++i) {
      const PixelPosition pixel{double(i % 20) * 8 + 4, double(i / 20) * 12 + 4};
      points.push_back({view.world_from_camera.point(ray_direction(view.intrinsics, pixel) * 3.0), 0.5, {v}});
    }
  }
  EXPECT_FALSE(found_in(capture, points).light.exists());
}

TEST(SeenSky, IsNotLookedForWhereAlphaCutsTheObjectOut) {
  Capture capture = outdoors(bright_sky);
  capture.is_bounded_object = true;
  EXPECT_FALSE(found_in(capture).light.exists());
}

TEST(SeenSky, IsNotLookedForBehindAMask) {
  Capture capture = outdoors(bright_sky);
  for (View& view : capture.views) {
    view.image.mask.assign(view.image.pixel_count(), 255);
    std::fill_n(view.image.mask.begin(), kWidth * kHeight * 3 / 4, std::uint8_t(0));
  }
  EXPECT_FALSE(found_in(capture).light.exists());
}

/// The exposures that a training found take the seams out.
TEST(SeenSky, LightIsThatOfTheMedianView) {
  Capture capture = outdoors(bright_sky);
  std::vector<ViewCorrection> corrections(capture.views.size());
  for (std::size_t v = 0; v < corrections.size(); ++v) {
    corrections[v].log_gain = v % 2 == 0 ? 0.2f : -0.1f;
    capture.views[v].image.exposure = 1 / corrections[v].gain();
  }
  const std::vector<TrainingView> views = training_views(capture, {});
  const SeenSky sky = find_sky(capture, views, {});
  ASSERT_TRUE(sky.light.exists());
  const DirectionMap light = sky_light(views, sky.labels, corrections);
  for (const float x : {1.0f, -1.0f}) {
    const Vec3f direction = normalized(Vec3f{x, 0.3f, 0.25f});
    const float truth = decode_transfer(Transfer::kSrgb, float(bright_sky(direction.cast<double>(), 0, 0) / 255));
    EXPECT_NEAR(light.plane(0).along(direction), truth, 0.01f);
  }
}

/// A model whose sky is as wide as that, saved.
std::filesystem::path saved_with_sky(const test::TempDir& folder, int width, std::size_t pixels) {
  Stage1Options options;
  options.grid.levels = 4;
  options.grid.log2_rows = 12;
  LuminanceModel model = LuminanceModel::create(test::toy_capture(), options, cpu_engines());
  model.sky = {width, width / 2, {std::vector<float>(pixels, 0.25f)}};
  std::filesystem::path file = folder / "stage1.snapshot";
  model.save(file);
  return file;
}

TEST(SeenSky, IsInTheSnapshot) {
  const test::TempDir folder;
  const LuminanceModel model = LuminanceModel::load(saved_with_sky(folder, 6, 18), cpu_engines());
  EXPECT_EQ(model.sky.width, 6);
  EXPECT_NEAR(model.sky_light().along({0, 1, 0}), 0.25f, 1e-6f);
}

TEST(SeenSky, ForgedSizesAreRefusedByName) {
  const test::TempDir folder;
  const auto message_of = [&](int width, std::size_t pixels) -> std::string {
    try {
      (void)LuminanceModel::load(saved_with_sky(folder, width, pixels), cpu_engines());
    } catch (const SnapshotError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(message_of(5, 10), testing::HasSubstr("sky_width"));
  EXPECT_THAT(message_of(8192, 10), testing::HasSubstr("sky_width"));
  EXPECT_THAT(message_of(6, 17), testing::HasSubstr("'sky' is damaged"));
}

}  // namespace
}  // namespace cnerf
