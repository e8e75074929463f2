#include "src/sample/sample_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/capture/color_truth.h"
#include "src/capture/image_io.h"
#include "src/capture/load_capture.h"
#include "src/color/colorspace_math.h"
#include "src/sample/scene.h"
#include "tests/support/data.h"
#include "tests/support/exr_channel.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;

const SampleSceneOptions kSmall = {.views = 10, .width = 64, .height = 48, .samples_per_pixel = 4, .seed = 1};

/// One scene for all tests that only look at it.
const fs::path& small_scene() {
  static const test::TempDir folder;
  static const bool written = [] {
    write_sample_scene(folder.path(), kSmall);
    return true;
  }();
  (void)written;
  return folder.path();
}

TEST(SampleScene, IsTheSameOnAnyNumberOfThreads) {
  const SampleSceneOptions tiny = {.views = 2, .width = 32, .height = 24, .samples_per_pixel = 4, .seed = 3};
  const test::TempDir one;
  const test::TempDir many;
  set_thread_count(1);
  write_sample_scene(one.path(), tiny);
  set_thread_count(4);
  write_sample_scene(many.path(), tiny);
  set_thread_count(0);
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(one.path())) {
    if (!entry.is_regular_file()) continue;
    EXPECT_EQ(read_binary_file(entry.path()), read_binary_file(many.path() / fs::relative(entry.path(), one.path())))
        << entry.path();
    ++files;
  }
  EXPECT_EQ(files, 2 * 3 + 2);
}

TEST(SampleScene, SeedChangesTheSamplingOnly) {
  SampleSceneOptions options = kSmall;
  options.views = 2;
  const test::TempDir folder;
  options.seed = 2;
  write_sample_scene(folder.path(), options);
  EXPECT_NE(read_binary_file(folder / "images/view_000.png"), read_binary_file(small_scene() / "images/view_000.png"));
  EXPECT_EQ(test::read_exr_channel(folder / "depth/view_000.exr", "Z").width, kSmall.width);
}

TEST(SampleScene, LoadsAsACapture) {
  const Capture capture = load_capture(small_scene());
  ASSERT_EQ(capture.views.size(), 10u);
  EXPECT_TRUE(capture.is_bounded_object);
  EXPECT_TRUE(capture.bounds);
  for (std::size_t i = 0; i < capture.views.size(); ++i) EXPECT_EQ(capture.views[i].held_out, i % 8 == 0) << i;
  EXPECT_TRUE(capture.notes.empty());  // grey images, exact poses, nothing missing
}

TEST(SampleScene, GreyIsTheLuminanceOfItsColourTruth) {
  const Capture capture = load_capture(small_scene());
  const View& view = capture.views[3];
  const auto truth = load_color_truth(view);
  ASSERT_TRUE(truth);
  double chroma = 0;
  for (std::size_t i = 0; i < view.image.pixel_count(); ++i) {
    const Vec3f rgb = {truth->rgb[3 * i], truth->rgb[3 * i + 1], truth->rgb[3 * i + 2]};
    ASSERT_NEAR(view.image.luminance(i), luminance_of(rgb), 0.006);  // both were rounded to 8 bits
    const Lab<float> lab = lab_from_linear_rgb(rgb);
    chroma += std::hypot(lab.a, lab.b) * view.image.coverage(i);
  }
  EXPECT_GT(chroma / double(view.image.pixel_count()), 5);  // it is a colourful scene
}

TEST(SampleScene, DepthsOfTwoViewsAgree) {
  const Capture capture = load_capture(small_scene());
  const auto depth_of = [](int view) {
    return test::read_exr_channel(small_scene() / "depth" / ("view_00" + std::to_string(view) + ".exr"), "Z");
  };
  // Neighbours on the orbit; a surface point of one, seen by the other, is at its depth or behind something.
  const View& from = capture.views[1];
  const View& to = capture.views[9];
  const test::ExrChannel from_depth = depth_of(1);
  const test::ExrChannel to_depth = depth_of(9);
  int agree = 0;
  int hidden = 0;
  int in_front = 0;
  for (int y = 0; y < kSmall.height; ++y) {
    for (int x = 0; x < kSmall.width; ++x) {
      const float depth = from_depth.values[std::size_t(y * kSmall.width + x)];
      if (depth == 0) continue;
      const Vec3d direction = ray_direction(from.intrinsics, {x + 0.5, y + 0.5});
      const Vec3d world = from.world_from_camera.point(direction * (depth / direction.z));
      const Vec3d seen = to.world_from_camera.inverse().point(world);
      const auto pixel = project(to.intrinsics, seen);
      ASSERT_TRUE(pixel);
      if (pixel->x < 0 || pixel->y < 0 || pixel->x >= kSmall.width || pixel->y >= kSmall.height) continue;
      const float other = to_depth.values[std::size_t(int(pixel->y) * kSmall.width + int(pixel->x))];
      // A pixel is 0.04 wide at this distance, and surfaces are steep.
      if (other != 0 && std::abs(other - seen.z) < 0.1)
        ++agree;
      else if (other != 0 && other < seen.z)
        ++hidden;
      else
        ++in_front;
    }
  }
  EXPECT_GT(agree, 500);
  EXPECT_LT(in_front, (agree + hidden) / 20);  // only silhouettes, where pixels disagree
}

TEST(SampleScene, DepthIsExactAlongTheOpticalAxis) {
  // The tip of the tree, seen from above.
  const Intrinsics intrinsics = {LensModel::kPinhole, 2, 2, 10, 10, 0.5, 0.5, {}};
  const Affined from_above = {Mat3d::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1}), {-0.32, -0.43, 3}};
  EXPECT_NEAR(sample::depth_of_pixel(intrinsics, from_above, 0, 0), 3 - 0.5, 1e-6);  // top of the red ball
}

TEST(SampleScene, DepthOfPixelsAgreesWithAlpha) {
  const Capture capture = load_capture(small_scene());
  const test::ExrChannel depth = test::read_exr_channel(small_scene() / "depth/view_002.exr", "Z");
  const MonoImage& image = capture.views[2].image;
  for (std::size_t i = 0; i < image.pixel_count(); ++i) {
    // Samples are inside the pixel, depth is at its centre: only a pixel that is partly covered may go either way.
    if (image.coverage(i) == 1) {
      EXPECT_GT(depth.values[i], 1.5) << i;
    } else if (image.coverage(i) == 0) {
      EXPECT_EQ(depth.values[i], 0) << i;
    }
  }
}

TEST(SampleScene, StaysInsideItsBoundsAndItsPictures) {
  const Capture capture = load_capture(small_scene());
  for (const View& view : capture.views) {
    const auto empty_at = [&](int x, int y) { return view.image.coverage(std::size_t(y * view.image.width + x)) == 0; };
    for (int x = 0; x < view.image.width; ++x)
      EXPECT_TRUE(empty_at(x, 0) && empty_at(x, kSmall.height - 1)) << view.name;
    for (int y = 0; y < view.image.height; ++y)
      EXPECT_TRUE(empty_at(0, y) && empty_at(kSmall.width - 1, y)) << view.name;
  }
  const Aabbd box = sample::bounds();
  for (const sample::Object& object : sample::objects()) EXPECT_TRUE(box.contains(object.shape.centre()));
}

TEST(SampleScene, ReferencesAreColourTrainingViews) {
  const Capture capture = load_capture(small_scene());
  for (const int view : {1, 2, 3}) {
    const std::string name = "view_00" + std::to_string(view) + ".png";
    EXPECT_EQ(read_binary_file(small_scene() / "references" / name), read_binary_file(small_scene() / "color" / name));
    EXPECT_FALSE(capture.views[std::size_t(view)].held_out);
  }
}

TEST(SampleScene, ColoursAreNeitherClippedNorDull) {
  const ColorImage image = load_color_image(small_scene() / "references/view_001.png");
  const auto clipped = std::count_if(image.rgb.begin(), image.rgb.end(), [](float v) { return v >= 0.999f; });
  EXPECT_LT(double(clipped), 0.002 * double(image.rgb.size()));
  EXPECT_GT(*std::max_element(image.rgb.begin(), image.rgb.end()), 0.5f);
}

TEST(SampleScene, ReportsProgressAndCanBeStopped) {
  SampleSceneOptions tiny = {.views = 3, .width = 16, .height = 16, .samples_per_pixel = 1, .seed = 1};
  const test::TempDir folder;
  std::vector<double> fractions;
  write_sample_scene(folder.path(), tiny, [&](const Progress& p) { fractions.push_back(p.fraction); });
  EXPECT_EQ(fractions.size(), 3u);
  EXPECT_DOUBLE_EQ(fractions.back(), 1);
  EXPECT_THROW(write_sample_scene(folder.path(), tiny, [](const Progress&) { throw Interrupted("stop"); }),
               Interrupted);
  request_interruption();
  EXPECT_THROW(write_sample_scene(folder / "stopped", tiny), Interrupted);
  forget_interruption();
  EXPECT_FALSE(fs::exists(folder / "stopped"));
}

TEST(SampleScene, OptionsAreChecked) {
  const test::TempDir folder;
  SampleSceneOptions options = kSmall;
  options.samples_per_pixel = 5;
  EXPECT_THROW(write_sample_scene(folder.path(), options), UsageError);
  options = kSmall;
  options.views = 1;
  EXPECT_THROW(write_sample_scene(folder.path(), options), UsageError);
}

class Shapes : public testing::TestWithParam<sample::ShapeKind> {};

/// Every hit lies on the surface: a ray from just outside along the inward normal hits at once, with the same normal.
TEST_P(Shapes, HitsAreConsistent) {
  const sample::Shape shape(GetParam(), {0.5, 0.3, 0.4}, {0.1, -0.2, 0.3});
  int hits = 0;
  for (int i = 0; i < 2000; ++i) {
    const double z = 1 - 2 * (i + 0.5) / 2000;
    const double angle = 2.399963 * i;
    const double across = std::sqrt(1 - z * z);
    const Vec3d outward = {across * std::cos(angle), across * std::sin(angle), z};
    const Vec3d target = Vec3d{0.1, -0.2, 0.3} + Vec3d{std::sin(1.7 * i), std::cos(2.3 * i), std::sin(3.1 * i)} * 0.35;
    const sample::Ray ray = {target + outward * 3.0, -outward};
    const auto hit = sample::intersect(shape, ray, 0, 100);
    if (!hit) continue;
    ++hits;
    ASSERT_TRUE(shape.may_meet(ray, 0, 100));
    ASSERT_NEAR(length(hit->normal), 1, 1e-9);
    ASSERT_LT(dot(hit->normal, ray.direction), 1e-9);
    const Vec3d surface = ray.origin + ray.direction * hit->t;
    if (dot(hit->normal, ray.direction) > -0.1) continue;  // grazing: edges are near
    const auto again = sample::intersect(shape, {surface + hit->normal * 1e-3, -hit->normal}, 0, 100);
    ASSERT_TRUE(again);
    ASSERT_NEAR(again->t, 1e-3, 1e-4);
    ASSERT_FALSE(sample::intersect(shape, {surface + hit->normal * 1e-4, hit->normal}, 0, 0.01));
    ASSERT_FALSE(sample::intersect(shape, ray, 0, hit->t - 1e-3));
  }
  EXPECT_GT(hits, 300);
}
INSTANTIATE_TEST_SUITE_P(All, Shapes,
                         testing::Values(sample::ShapeKind::kSphere, sample::ShapeKind::kBox,
                                         sample::ShapeKind::kCylinder, sample::ShapeKind::kCone,
                                         sample::ShapeKind::kCapsule, sample::ShapeKind::kTorus));

Capture disturbed(const SampleSceneOptions& options) {
  const test::TempDir folder;
  write_sample_scene(folder.path(), options);
  return load_capture(folder.path());
}

TEST(SampleScene, AClothLeavesNothingCutOut) {
  SampleSceneOptions options = kSmall;
  options.cloth = true;
  const Capture capture = disturbed(options);
  EXPECT_FALSE(capture.is_bounded_object);
  for (const View& view : capture.views) {
    for (std::size_t p = 0; p < view.image.pixel_count(); ++p) ASSERT_EQ(view.image.coverage(p), 1) << view.name;
  }
}

/// Light of a view over that of the same view undisturbed, pixel by pixel.
std::vector<double> ratios(const View& view, const View& undisturbed) {
  std::vector<double> out;
  for (std::size_t p = 0; p < view.image.pixel_count(); ++p) {
    const double before = undisturbed.image.luminance(p);
    if (before > 0.1 && before < 0.7) out.push_back(view.image.luminance(p) / before);  // not coarse, not clipped
  }
  return out;
}

TEST(SampleScene, ExposuresScaleAViewAndTheShadowDimsAPartOfIt) {
  SampleSceneOptions options = kSmall;
  options.cloth = true;
  const Capture plain = disturbed(options);
  options.exposures = true;
  const Capture exposed = disturbed(options);
  options.exposures = false;
  options.moving_shadow = true;
  const Capture shadowed = disturbed(options);
  double least = 2, most = 0;
  for (std::size_t v = 0; v < plain.views.size(); ++v) {
    const std::vector<double> gains = ratios(exposed.views[v], plain.views[v]);
    const auto [low, high] = std::ranges::minmax(gains);
    EXPECT_LT(high - low, 0.1) << "one gain for the view";
    least = std::min(least, low);
    most = std::max(most, high);
    const std::vector<double> dimmed = ratios(shadowed.views[v], plain.views[v]);
    EXPECT_LT(std::ranges::min(dimmed), 0.6);
    EXPECT_GT(std::ranges::max(dimmed), 0.95) << "far from the photographer";
  }
  EXPECT_LT(least, 0.9);
  EXPECT_GT(most, 1.1);
  EXPECT_GT(least, 0.65);
  EXPECT_LT(most, 1.35);
}

/// Half of the pixels, brighter than the rest, and told by a picture of their own.
TEST(SampleScene, OutdoorsHalfOfThePixelsAreSky) {
  SampleSceneOptions options = kSmall;
  options.sky = true;
  const test::TempDir folder;
  write_sample_scene(folder.path(), options);
  const Capture capture = load_capture(folder.path(), {});
  double sky = 0, all = 0, darkest_sky = 1;
  for (const View& view : capture.views) {
    EXPECT_TRUE(view.image.alpha.empty());
    const std::vector<std::uint8_t> mask =
        read_mask(folder / "sky" / fs::path(view.name).filename().string(), options.width, options.height);
    for (std::size_t p = 0; p < mask.size(); ++p) {
      all += 1;
      if (mask[p] == 0) continue;
      sky += 1;
      darkest_sky = std::min(darkest_sky, double(view.image.luminance(p)));
    }
  }
  EXPECT_NEAR(sky / all, 0.5, 0.08);
  EXPECT_GT(darkest_sky, 0.3);
  EXPECT_FALSE(capture.bounds.has_value());
}

}  // namespace
}  // namespace cnerf
