#include "tests/bake/whole_bake.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "bake/color/point_color.h"
#include "bake/density/density_pass.h"
#include "bake/volume/dilate.h"
#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"
#include "tests/bake/analytic_field.h"
#include "tests/support/data.h"

namespace cnerf::bake::test {
namespace {

const SceneFrame kBoxFrame{{1, 2, 3}, 0.5, 1};  // world box: 2 units around (1, 2, 3)

/// A box of 1 x 0.5 x 0.5 world units, 40 x 20 x 20 voxels of 0.025.
AnalyticField slab(float sigma_unit, Chromaticity chromaticity = {}) {
  return {kBoxFrame, box_density({0.25f, 0.375f, 0.375f}, {0.75f, 0.625f, 0.625f}, sigma_unit), 0.5f, chromaticity};
}

Options slab_options() {
  Options options;
  options.voxel_size = 0.025;
  options.aabb = "0.25,1.5,2.5,1.75,2.5,3.5";
  return options;
}

/// Optical depth of each column along x.
std::map<std::pair<int, int>, double> column_depths(const Volume& volume) {
  std::map<std::pair<int, int>, double> depths;
  for (const Voxel& v : volume.voxels) {
    if (v.sigma > 0) depths[{v.j, v.k}] += double(v.sigma) * volume.voxel_size;
  }
  return depths;
}

TEST(BakeVolume, OpticalDepthOfASlabIsExactInWorldUnits) {
  const float sigma_unit = 3;  // 1.5 per world unit, over 1 world unit
  const Volume volume = bake_volume(slab(sigma_unit), {}, slab_options());
  const auto depths = column_depths(volume);
  EXPECT_EQ(depths.size(), 400u);
  for (const auto& [column, depth] : depths) EXPECT_NEAR(depth, 1.5, 1e-5);
}

TEST(BakeVolume, HalfCoveredVoxelsLetHalfOfTheLightThrough) {
  // The slab's faces towards y and z cut voxels in the middle.
  AnalyticField field(kBoxFrame, box_density({0.25f, 0.375f, 0.375f}, {0.75f, 0.63125f, 0.625f}, 400), 0.5f);
  Options options = slab_options();
  options.subsamples = 4;
  options.sharpening = 0;
  const Volume volume = bake_volume(field, {}, options);
  const double full = std::exp(-200 * volume.voxel_size), half = (1 + full) / 2;
  std::size_t halves = 0;
  for (const Voxel& v : volume.voxels) {
    if (v.sigma == 0) continue;
    const double transmittance = std::exp(-v.sigma * volume.voxel_size);
    const bool is_half = std::abs(transmittance - half) < 1e-5;
    EXPECT_TRUE(is_half || std::abs(transmittance - full) < 1e-5) << transmittance;
    halves += is_half ? 1 : 0;
  }
  EXPECT_EQ(halves, 40u * 20u);
}

TEST(BakeVolume, VoxelsLieWhereTheBoxIs) {
  const Volume volume = bake_volume(slab(3), {}, slab_options());
  Aabbd box = Aabbd::empty();
  for (const Voxel& v : volume.voxels) {
    EXPECT_TRUE(v.i >= 0 && v.j >= 0 && v.k >= 0);
    EXPECT_TRUE(v.i < volume.resolution.x && v.j < volume.resolution.y && v.k < volume.resolution.z);
    if (v.sigma == 0) continue;
    const Vec3d corner = volume.origin + Vec3i{v.i, v.j, v.k}.cast<double>() * volume.voxel_size;
    box.grow(corner);
    box.grow(corner + Vec3d{1, 1, 1} * volume.voxel_size);
  }
  EXPECT_NEAR(length(box.min - Vec3d{0.5, 1.75, 2.75}), 0, 1e-6);
  EXPECT_NEAR(length(box.max - Vec3d{1.5, 2.25, 3.25}), 0, 1e-6);
}

TEST(BakeVolume, ColorIsLuminanceTimesChromaticity) {
  const Vec3f wanted{0.2f, 0.5f, 0.8f};
  const Vec3f xyz = relative_xyz_from_linear_rgb(wanted);
  AnalyticField field = slab(3, {xyz.x / xyz.y, xyz.z / xyz.y});
  field.with_luminance([&](Vec3f, Vec3f) { return xyz.y; });
  const Lab<float> lab = lab_from_linear_rgb(wanted);
  for (const Voxel& v : bake_volume(field, {}, slab_options()).voxels) {
    EXPECT_NEAR(length(v.rgb - wanted), 0, 1e-5);
    EXPECT_NEAR(v.luminance, xyz.y, 1e-5);
    EXPECT_NEAR(v.a, lab.a, 1e-2);
    EXPECT_NEAR(v.b, lab.b, 1e-2);
  }
}

TEST(BakeVolume, GreyIsGreyExactly) {
  for (const Voxel& v : bake_volume(slab(3), {}, slab_options()).voxels) {
    EXPECT_EQ(v.rgb, (Vec3f{0.5f, 0.5f, 0.5f}));
    EXPECT_EQ(v.a, 0);
    EXPECT_EQ(v.b, 0);
  }
}

TEST(VoxelColor, OutOfGamutLosesChromaNotHueOrLightness) {
  const VoxelColor color = voxel_color(0.3f, {3.0f, 0.1f});
  for (int c = 0; c < 3; ++c) {
    EXPECT_GE(color.rgb[c], -1e-4f);
    EXPECT_LE(color.rgb[c], 1 + 1e-4f);
  }
  EXPECT_NEAR(luminance_of(color.rgb), 0.3f, 2e-3f);
  const Lab<float> asked = lab_from_linear_rgb(linear_rgb_from_relative_xyz(Vec3f{0.9f, 0.3f, 0.03f}));
  EXPECT_NEAR(std::atan2(color.b, color.a), std::atan2(asked.b, asked.a), 2e-2f);
}

TEST(VoxelColor, GainMultipliesTheColorOfTheLightBelow) {
  const Chromaticity chromaticity{1.6f, 0.4f};
  const VoxelColor plain = voxel_color(0.3f, chromaticity), bright = voxel_color(1.2f, chromaticity, 4.0f);
  for (int c = 0; c < 3; ++c) EXPECT_FLOAT_EQ(bright.rgb[c], 4 * plain.rgb[c]);
  EXPECT_GT(bright.a, plain.a) << "Lab is that of the brighter light";
}

TEST(BakeVolume, ColorReachesTwoVoxelsBeyondDensity) {
  const Volume volume = bake_volume(slab(3), {}, slab_options());
  std::map<std::tuple<int, int, int>, float> sigma;
  for (const Voxel& v : volume.voxels) sigma[{v.i, v.j, v.k}] = v.sigma;
  EXPECT_EQ(volume.voxels.size(), 44u * 24u * 24u);
  EXPECT_EQ(std::count_if(sigma.begin(), sigma.end(), [](const auto& v) { return v.second > 0; }), 40 * 20 * 20);
}

TEST(BakeVolume, DensityIsClampedWhereAVoxelIsOpaque) {
  const Volume volume = bake_volume(slab(1e6f), {}, slab_options());
  for (const Voxel& v : volume.voxels) {
    EXPECT_TRUE(v.sigma == 0 || std::abs(v.sigma - 20 / 0.025f) < 1e-2f) << v.sigma;
  }
}

TEST(BakeVolume, RefusesDensitiesThatAreNone) {
  for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity(), -1.0f}) {
    EXPECT_THROW((void)bake_volume(slab(bad), {}, slab_options()), ContractError) << bad;
  }
}

TEST(BakeVolume, FaintVoxelsAreDropped) {
  Options options = slab_options();
  options.opacity_threshold = 0.1;  // sigma h = 1.5 * 0.025: alpha 0.037
  EXPECT_THROW((void)bake_volume(slab(3), {}, options), InputError);
  options.opacity_threshold = 0.03;
  EXPECT_FALSE(bake_volume(slab(3), {}, options).voxels.empty());
}

/// A camera on the +x side of the slab.
Camera camera_at_positive_x() {
  return camera_at("right", {5, 2, 3}, {1, 2, 3}, 64, 64, 100);
}

TEST(BakeVolume, LuminanceIsWhatTheCamerasSee) {
  AnalyticField field = slab(3);
  // Seen along -x: 0.8, along +x: 0.2, along anything else: 7.
  field.with_luminance([](Vec3f, Vec3f d) { return d.x < -0.9f ? 0.8f : d.x > 0.9f ? 0.2f : 7.0f; });
  const Volume one = bake_volume(field, {camera_at_positive_x()}, slab_options());
  for (const Voxel& v : one.voxels) EXPECT_NEAR(v.luminance, 0.8f, 1e-5f);

  const Camera left = camera_at("left", {-3, 2, 3}, {1, 2, 3}, 64, 64, 100);
  const Volume both = bake_volume(field, {camera_at_positive_x(), left}, slab_options());
  std::size_t mixed = 0;
  for (const Voxel& v : both.voxels) {
    EXPECT_GT(v.luminance, 0.2f - 1e-5f);
    EXPECT_LT(v.luminance, 0.8f + 1e-5f);
    mixed += v.luminance > 0.21f && v.luminance < 0.79f ? 1 : 0;
  }
  EXPECT_GT(mixed, both.voxels.size() / 4);  // the others are seen by one camera only, the other's view is too dim
}

TEST(BakeVolume, VoxelsThatNoCameraSeesAreDropped) {
  const AnalyticField field = slab(400);  // 5 optical depths a voxel
  const auto dense = [](const Volume& volume) {
    return std::count_if(volume.voxels.begin(), volume.voxels.end(), [](const auto& v) { return v.sigma > 0; });
  };
  Options options = slab_options();
  options.weight_threshold = 0.006;
  const Volume seen = bake_volume(field, {camera_at_positive_x()}, options);
  // The face towards the camera and the voxel behind it (e^-5 of the light).
  EXPECT_EQ(dense(seen), 2 * 20 * 20);
  const double nearest_dropped = 1.5 - 4.01 * seen.voxel_size;  // two kept, two dilated
  for (const Voxel& v : seen.voxels) EXPECT_GT(seen.origin.x + v.i * seen.voxel_size, nearest_dropped);
  options.weight_threshold = 0.007;
  EXPECT_EQ(dense(bake_volume(field, {camera_at_positive_x()}, options)), 20 * 20);
  options.keep_unseen = true;
  EXPECT_EQ(dense(bake_volume(field, {camera_at_positive_x()}, options)), 40 * 20 * 20);
}

TEST(BakeVolume, VoxelsThatHardlyReachAnyPixelAreDropped) {
  // Fog in front of the camera and a wall: behind the wall fog is seen by nobody, in front each voxel takes 2.5 %.
  AnalyticField field(kBoxFrame, box_density({0.25f, 0.375f, 0.375f}, {0.75f, 0.625f, 0.625f}, 2));
  const auto dense = [&](double threshold) {
    Options options = slab_options();
    options.weight_threshold = threshold;
    std::size_t count = 0;
    for (const Voxel& v : bake_volume(field, {camera_at_positive_x()}, options).voxels) count += v.sigma > 0;
    return count;
  };
  EXPECT_EQ(dense(0), 40u * 20 * 20);
  // Light of the k-th layer: 0.0247 exp(-0.025 k), which falls below 0.0125 at layer 27.
  EXPECT_NEAR(double(dense(0.0125)) / (20 * 20), 27, 2.5);
  EXPECT_THROW((void)dense(0.03), InputError);
}

TEST(BakeVolume, NothingSeenIsAnInputError) {
  const Camera away = camera_at("away", {5, 2, 3}, {9, 2, 3}, 64, 64, 100);
  EXPECT_THROW((void)bake_volume(slab(3), {away}, slab_options()), InputError);
}

/// A camera that sees nothing but a faint layer on dense matter, whose density goes into what is beside it.
TEST(BakeVolume, ColoursWithoutDensityAreNoVolume) {
  const AnalyticField field(kBoxFrame, [](Vec3f p) {
    const bool is_matter = Aabbf{{0.25f, 0.375f, 0.375f}, {0.75f, 0.625f, 0.625f}}.contains(p);
    const bool is_layer = Aabbf{{0.25f, 0.375f, 0.625f}, {0.75f, 0.625f, 0.6375f}}.contains(p);
    return is_matter ? 400.0f : is_layer ? 2.0f : 0.0f;  // the layer is a voxel thick
  });
  const Camera camera = camera_at("along", {5, 2.0125, 3.2625}, {1, 2.0125, 3.2625}, 64, 64, 12000);
  Options options = slab_options();
  options.sharpening = 0;
  EXPECT_FALSE(bake_volume(field, {camera}, options).voxels.empty());
  options.sharpening = 1;
  EXPECT_THROW((void)bake_volume(field, {camera}, options), InputError);
}

TEST(BakeVolume, DoesNotDependOnTheNumberOfThreads) {
  AnalyticField field(kBoxFrame, sphere_density({0.5f, 0.45f, 0.55f}, 0.2f, 30));
  field.with_luminance([](Vec3f p, Vec3f d) { return p.x + 0.3f * d.y + 0.4f; });
  field.with_chromaticity([](Vec3f p) { return Chromaticity{0.9f + 0.2f * p.y, 1.1f - 0.2f * p.z}; });
  const std::vector<Camera> cameras{camera_at_positive_x(), camera_at("top", {1, 2, 8}, {1, 2, 3}, 64, 64, 100)};
  Options options;
  options.resolution = 40;
  set_thread_count(1);
  const Volume one = bake_volume(field, cameras, options);
  set_thread_count(4);
  const Volume four = bake_volume(field, cameras, options);
  set_thread_count(0);
  ASSERT_EQ(one.voxels.size(), four.voxels.size());
  for (std::size_t v = 0; v < one.voxels.size(); ++v) EXPECT_EQ(one.voxels[v], four.voxels[v]) << v;
}

TEST(BakeVolume, ReportsProgressUpToTheEndAndStopsWhenTold) {
  std::vector<double> shares;
  (void)bake_volume(slab(3), {}, slab_options(), [&](const Progress& p) { shares.push_back(p.fraction); });
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_EQ(shares.back(), 1.0);
  EXPECT_THROW((void)bake_volume(slab(3), {}, slab_options(), [](const Progress&) { throw Interrupted("stop"); }),
               Interrupted);
}

/// @param threads  of which many make several planes at the same time
void stop_and_go_on(int threads) {
  set_thread_count(threads);
  const cnerf::test::TempDir folder;
  const AnalyticField field = slab(30);
  const std::vector<Camera> cameras{camera_at_positive_x()};
  const Options options = slab_options();
  const std::vector<Plan> plans{plan_bake(field, options)};
  const auto bake = [&](Journal& journal, const ProgressSink& sink) {
    const auto levels = bake_levels(field, plans, options, journal, sink);
    return whole_volume(bake_volumes(field, cameras, levels, options, journal, sink).front()).voxels;
  };
  Journal undisturbed;
  const std::vector<Voxel> expected = bake(undisturbed, {});
  ASSERT_FALSE(expected.empty());

  int stops = 0;
  for (std::size_t planes = 1;; ++planes) {  // every run is stopped after one plane more
    std::size_t done = 0;
    Journal journal(folder / "unfinished", "bake");
    EXPECT_GE(journal.found(), planes - 1) << "what is made is kept";
    try {
      EXPECT_EQ(bake(journal,
                     [&](const Progress&) {
                       if (++done == planes) throw Interrupted("stop");
                     }),
                expected);
      break;
    } catch (const Interrupted&) {
      ++stops;
    }
  }
  EXPECT_EQ(stops, 2 * plane_count(plans[0]));
  set_thread_count(0);
}

TEST(BakeVolume, AStoppedBakeGoesOnToTheSameVoxels) {
  stop_and_go_on(1);
  stop_and_go_on(16);
}

TEST(BakeVolume, IsTheSameReadInPlanesAndWhole) {
  Journal journal;
  const AnalyticField field = slab(3);
  const Options options = slab_options();
  const auto levels = bake_levels(field, {plan_bake(field, options)}, options, journal);
  const VolumePlanes planes = bake_volumes(field, {}, levels, options, journal).front();
  EXPECT_EQ(whole_volume(dilated(planes, options.dilation)).voxels, bake_volume(field, {}, options).voxels);
  EXPECT_EQ(planes.statistics.voxels, 40u * 20 * 20);
  EXPECT_EQ(planes.statistics.dense.size(), (Vec3i{40, 20, 20}));
}

}  // namespace
}  // namespace cnerf::bake::test
