/// What Blender shows of our files, against closed formulas and against our own integrator.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "bake/density/nested.h"
#include "bake/volume/dilate.h"
#include "bake/volume/integrate.h"
#include "export/bake_folder.h"
#include "export/web_pictures.h"
#include "src/base/files.h"
#include "src/color/colorspace_math.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/whole_bake.h"
#include "tests/blender/blender_run.h"
#include "tests/export/test_volumes.h"
#include "tests/export/whole_export.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
using namespace bake::test;
namespace {

const Vec3f kColor{0.2f, 0.5f, 0.8f};

Vec3d voxel_position(const bake::Volume& volume, Vec3d voxel) {
  return volume.origin + voxel * volume.voxel_size;
}

TEST(Blender, SlabIsBeerAndLambertThroughAnOrthographicCamera) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const bake::Volume volume = block_volume({0, 0, 0}, {40, 40, 10}, 1.0f);  // 2 x 2 x 0.5 world units
  const Vec3d middle = voxel_position(volume, {20, 20, 5});
  const bake::Camera camera = camera_at("above", middle + Vec3d{0, 0, 4}, middle, 33, 33, 60);
  const VolumeExport bake = export_volume(volume, {camera}, folder.path(), "slab");

  std::ofstream(folder / "ortho.py") << "import bpy\n"
                                        "scene = bpy.context.scene\n"
                                        "scene.camera.data.type = 'ORTHO'\n"
                                        "scene.camera.data.ortho_scale = 1.0\n"
                                        "scene.render.image_settings.file_format = 'OPEN_EXR'\n"
                                        "scene.render.image_settings.color_depth = '32'\n"
                                        "scene.render.image_settings.color_mode = 'RGBA'\n"
                                        "scene.render.filepath = r'" +
                                            (folder / "ortho.exr").string() +
                                            "'\n"
                                            "bpy.ops.render.render(write_still=True)\n";
  ASSERT_EQ(run_blender(bake.blender_setup, "--exact --step-rate 0.25 --samples 64", folder / "ortho.py"), 0)
      << read_text_file(folder / "blender.log");
  const RenderedExr image = read_exr(folder / "ortho.exr");
  const double opacity = 1 - std::exp(-0.5);  // 0.3935
  const float* centre = image.pixel(16, 16);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(centre[c], kColor[c] * opacity, 1e-3);
  EXPECT_NEAR(centre[3], opacity, 1e-3);
}

TEST(Blender, DenseSphereHasItsColorFromCoreToRim) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const Vec3f xyz = relative_xyz_from_linear_rgb(kColor);
  const AnalyticField sphere({{0, 0, 0}, 0.5, 1}, sphere_density({0.5f, 0.5f, 0.5f}, 0.2f, 400), xyz.y,
                             {xyz.x / xyz.y, xyz.z / xyz.y});  // 200 per world unit
  bake::Options options;
  options.voxel_size = 1.0 / 64;
  const bake::Volume volume = bake_volume(sphere, {}, options);
  const bake::Camera camera = camera_at("front", {0, -3, 0}, {0, 0, 0}, 96, 96, 300);
  const VolumeExport bake = export_volume(volume, {camera}, folder.path(), "sphere");
  const RenderedExr image = render_exact(bake.blender_setup, "--step-rate 0.25 --samples 64");

  int core = 0, rim = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const float* p = image.pixel(x, y);
      if (p[3] < 0.01f) continue;
      (p[3] > 0.999f ? core : rim) += 1;
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(p[c] / (p[3] * kColor[c]), 1, 1e-3) << x << ", " << y << ": " << p[3];
    }
  }
  EXPECT_GT(core, 2000);
  EXPECT_GT(rim, 100);
}

/// Where optical depth passes half of `inside` along a line of pixels, in pixels; `depth(i)` at pixel centre i + 0.5.
template <typename Depth>
double half_crossing(int begin, int step, double inside, const Depth& depth) {
  for (int i = begin; i >= 0 && i < 1000; i += step) {
    const double a = depth(i) - inside / 2, b = depth(i + step) - inside / 2;
    if (a <= 0 && b > 0) return i + 0.5 + step * a / (a - b);
  }
  return -1;
}

struct Edges {
  double left = 0, right = 0, top = 0, bottom = 0;  ///< pixels
};

Edges find_edges(const RenderedExr& image, double inside) {
  const int middle = image.width / 2;
  const auto depth = [&](int x, int y) { return -std::log1p(-double(image.pixel(x, y)[3])); };
  const auto across = [&](int i) { return depth(i, middle); };
  const auto down = [&](int i) { return depth(middle, i); };
  return {half_crossing(0, 1, inside, across), half_crossing(image.width - 1, -1, inside, across),
          half_crossing(0, 1, inside, down), half_crossing(image.height - 1, -1, inside, down)};
}

class VoxelOrigin : public testing::TestWithParam<const char*> {};

TEST_P(VoxelOrigin, EdgesAreWithinATenthOfAVoxel) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const bake::Volume volume = block_volume({2, 3, 4}, {14, 15, 16}, 2.0f);  // 12 voxels of 0.05 along each axis
  const Vec3d middle = voxel_position(volume, {8, 9, 10});
  const double far = 500, pixels_per_voxel = 4;
  const double focal = pixels_per_voxel * far / volume.voxel_size;
  const std::vector<bake::Camera> cameras{camera_at("z", middle + Vec3d{0, 0, far}, middle, 72, 72, focal),
                                          camera_at("x", middle + Vec3d{far, 0, 0}, middle, 72, 72, focal)};
  VdbOptions options;
  options.voxel_origin = GetParam();
  const VolumeExport bake = export_volume(volume, cameras, folder.path(), "block", options);
  const double inside = 2.0 * 12 * volume.voxel_size;
  const double near_face = 36 - 6 * pixels_per_voxel, far_face = 36 + 6 * pixels_per_voxel;
  const double tenth = 0.1 * pixels_per_voxel;
  const std::vector<std::string> names = {"z", "x"};
  const auto images = render_cameras(bake.blender_setup, "--exact --step-rate 0.25 --samples 32", names);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string& camera = names[i];
    const Edges edges = find_edges(images[i], inside);
    EXPECT_NEAR(edges.left, near_face, tenth) << camera;
    EXPECT_NEAR(edges.right, far_face, tenth) << camera;
    EXPECT_NEAR(edges.top, near_face, tenth) << camera;
    EXPECT_NEAR(edges.bottom, far_face, tenth) << camera;
  }
}
INSTANTIATE_TEST_SUITE_P(Rule, VoxelOrigin, testing::Values("center", "corner"));

/// Three soft balls of different colours and densities.
bake::Volume soft_scene() {
  struct Ball {
    Vec3f centre;
    float radius, sigma;
    Vec3f rgb;
  };
  static const std::vector<Ball> balls{{{0.40f, 0.42f, 0.45f}, 0.16f, 60, {0.8f, 0.25f, 0.15f}},
                                       {{0.62f, 0.50f, 0.55f}, 0.14f, 25, {0.15f, 0.55f, 0.75f}},
                                       {{0.50f, 0.62f, 0.38f}, 0.12f, 120, {0.35f, 0.7f, 0.2f}}};
  const auto weight = [](const Ball& ball, Vec3f p) {
    const float q = length(p - ball.centre) / ball.radius;
    return q < 1 ? ball.sigma * (1 - q * q) : 0.0f;
  };
  const auto color = [weight](Vec3f p) {
    Vec3f sum{};
    float total = 1e-6f;
    for (const Ball& ball : balls) {
      sum += ball.rgb * weight(ball, p);
      total += weight(ball, p);
    }
    return relative_xyz_from_linear_rgb(sum / total);
  };
  AnalyticField field({{2, -1, 0.5}, 0.5, 1}, [weight](Vec3f p) {
    float sigma = 0;
    for (const Ball& ball : balls) sigma += weight(ball, p);
    return sigma;
  });
  field.with_luminance([color](Vec3f p, Vec3f) { return color(p).y; });
  field.with_chromaticity([color](Vec3f p) {
    const Vec3f xyz = color(p);
    return xyz.y > 0 ? Chromaticity{xyz.x / xyz.y, xyz.z / xyz.y} : Chromaticity{};
  });
  bake::Options options;
  options.resolution = 56;
  return bake_volume(field, {}, options);
}

struct Comparison {
  double psnr = 0;  ///< of linear RGB, against 1
  double worst_opacity = 0;
  std::size_t pixels = 0;
};

/// Over the pixels that hold something in either picture.
Comparison compare(const RenderedExr& cycles, const bake::VolumeImage& ours) {
  Comparison result;
  double squared = 0;
  for (int y = 0; y < ours.height; ++y) {
    for (int x = 0; x < ours.width; ++x) {
      const std::size_t at = std::size_t(y) * ours.width + x;
      const float* p = cycles.pixel(x, y);
      if (ours.opacity[at] <= 0.01f && p[3] <= 0.01f) continue;
      ++result.pixels;
      for (int c = 0; c < 3; ++c) squared += std::pow(double(p[c]) - ours.rgb[3 * at + c], 2);
      result.worst_opacity = std::max<double>(result.worst_opacity, std::abs(p[3] - ours.opacity[at]));
    }
  }
  result.psnr = -10 * std::log10(squared / double(3 * result.pixels));
  return result;
}

TEST(Blender, CyclesAndOurIntegratorAgree) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const bake::Volume volume = soft_scene();
  bake::Camera camera = camera_at("three quarters", {3.6, -3.4, 1.9}, {2, -1, 0.5}, 160, 120, 260);
  camera.intrinsics.fy = 234;  // pixels that are not square, axis off the middle
  camera.intrinsics.cx = 71;
  camera.intrinsics.cy = 66.5;
  const VolumeExport bake = export_volume(volume, {camera}, folder.path(), "balls");
  const RenderedExr cycles = render_exact(bake.blender_setup, "--step-rate 0.25 --samples 64");
  const bake::VolumeImage ours = bake::integrate_volumes({&volume, 1}, camera.intrinsics, camera.world_from_camera);
  const Comparison equal = compare(cycles, ours);
  RecordProperty("psnr_millidecibel", int(1000 * equal.psnr));
  std::printf("Cycles against our integrator: %.2f dB over %zu pixels, opacity within %.4f\n", equal.psnr, equal.pixels,
              equal.worst_opacity);
  EXPECT_GT(equal.pixels, 2000u);
  EXPECT_GE(equal.psnr, 40);

  // The measure must notice half a voxel.
  bake::Volume shifted = volume;
  shifted.origin = shifted.origin + Vec3d{0.5, 0.5, 0.5} * shifted.voxel_size;
  EXPECT_LT(compare(cycles, bake::integrate_volumes({&shifted, 1}, camera.intrinsics, camera.world_from_camera)).psnr,
            40);
}

/// Off the middle in every direction, so that no wrong turn maps it onto itself.
TEST(Blender, AFileThatStandsUpLiesWhereThePosesHaveIt) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const bake::Volume volume = soft_scene();
  const bake::Camera camera = camera_at("three quarters", {3.6, -3.4, 1.9}, {2, -1, 0.5}, 80, 60, 130);
  VdbOptions options;
  options.up = "y";
  const VolumeExport bake = export_volume(volume, {camera}, folder.path(), "balls", options);
  const RenderedExr cycles = render_exact(bake.blender_setup, "--step-rate 0.25 --samples 32");
  const Comparison equal =
      compare(cycles, bake::integrate_volumes({&volume, 1}, camera.intrinsics, camera.world_from_camera));
  EXPECT_GT(equal.pixels, 500u);
  EXPECT_GE(equal.psnr, 40);
}

TEST(Blender, TheSceneShowsColoursAsTheyAreAndSkipsNoVoxel) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  bake::Volume volume = block_volume({0, 0, 0}, {4, 4, 4}, 1);
  volume.voxels.push_back(volume.voxels.back());
  volume.voxels.back().i = 1400;  // the diagonal has more voxels than Cycles has steps by default
  const VolumeExport bake = export_volume(volume, {}, folder.path(), "block");
  std::ofstream(folder / "check.py")
      << "import bpy\n"
         "scene = bpy.data.scenes['cnerf']\n"
         "assert scene.view_settings.view_transform == 'Standard'\n"
         "assert scene.cycles.volume_step_rate <= 1 and scene.cycles.volume_max_steps > 1400\n"
         "data = [o.data for o in scene.objects if o.type == 'VOLUME'][0]\n"
         "assert data.render.space == 'OBJECT' and data.render.step_size == 0 and data.render.clipping == 0\n"
         "assert data.render.precision == 'HALF'\n"
         "assert all(a == b for a, b in zip(data.materials[0].node_tree.nodes['Volume Absorption'].inputs['Color']"
         ".default_value, (0, 0, 0, 1)))\n"
         "assert not [n for n in data.materials[0].node_tree.nodes if n.type == 'PRINCIPLED_VOLUME']\n";
  EXPECT_EQ(run_blender(bake.blender_setup, "", folder / "check.py"), 0) << read_text_file(folder / "blender.log");
}

TEST(Blender, NestedGridsAgreeWithOurIntegrator) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  AnalyticField field({{0, 0, 0}, 0.25, 2}, [](Vec3f p) {
    const float q = length(p - Vec3f{0.5f, 0.5f, 0.5f});
    return q < 0.3f ? 12 * (1 - q / 0.3f) : 0.0f;
  });
  field.with_luminance([](Vec3f p, Vec3f) { return 0.2f + 0.5f * p.x; });
  const bake::Camera camera = camera_at("front", {0.5, -6, 0.7}, {0, 0, 0}, 96, 96, 180);
  bake::Options options;
  options.resolution = 32;
  const std::vector<bake::Camera> cameras{camera, camera_at("right", {6, 0.4, 0}, {0, 0, 0}, 96, 96, 180)};
  bake::Journal journal;
  const auto levels = bake_levels(field, plan_levels(field, cameras, options), options, journal);
  const std::vector<bake::VolumePlanes> planes = bake_volumes(field, cameras, levels, options, journal);
  ASSERT_GT(planes.size(), 1u);
  std::vector<bake::VolumePlanes> wide;
  for (const bake::VolumePlanes& level : planes) wide.push_back(dilated(level, options.dilation));
  std::vector<bake::Volume> volumes;
  for (const bake::VolumePlanes& level : wide) volumes.push_back(whole_volume(level));
  BakeFolder bake(folder.path(), cameras, label_of_first("y"));  // stands up: the Empty turns everything with it
  bake.add_volumes(wide, "volume", {});
  bake.finish();
  const RenderedExr cycles = render_exact(bake.blender_setup(), "--step-rate 0.25 --samples 64");
  const bake::VolumeImage ours = integrate_volumes(volumes, camera.intrinsics, camera.world_from_camera);
  const Comparison equal = compare(cycles, ours);
  std::printf("Nested grids, Cycles against our integrator: %.2f dB over %zu pixels\n", equal.psnr, equal.pixels);
  EXPECT_GT(equal.pixels, 1000u);
  EXPECT_GE(equal.psnr, 40);
}

TEST(Blender, RegradingRebuildsTheColorAndTurnsItGrey) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  bake::Volume volume = block_volume({0, 0, 0}, {20, 20, 20}, 40);
  const Lab<float> lab = lab_from_linear_rgb(kColor);
  for (bake::Voxel& v : volume.voxels) {
    v.luminance = luminance_of(kColor);
    v.a = lab.a;
    v.b = lab.b;
  }
  const Vec3d middle = voxel_position(volume, {10, 10, 10});
  const bake::Camera camera = camera_at("front", middle + Vec3d{0, -5, 0}, middle, 16, 16, 60);
  const VolumeExport bake = export_volume(volume, {camera}, folder.path(), "block");
  const float y = luminance_of(kColor);
  Lab<float> opposite = lab;
  opposite.a = -lab.a * 0.5f;
  opposite.b = -lab.b * 0.5f;
  const struct {
    std::string grade;
    Vec3f color;
    float tolerance;
  } expected[] = {{"--regrade 1", kColor, 3e-3f},
                  {"--regrade 1 --saturation 0", {y, y, y}, 3e-3f},
                  {"--regrade 1 --saturation 0 --exposure 1", Vec3f{y, y, y} * 2.0f, 6e-3f},
                  {"--regrade 1 --hue 180 --saturation 0.5", linear_rgb_from_lab(opposite), 3e-3f}};
  std::vector<std::string> arguments;
  for (const auto& each : expected) arguments.push_back("--samples 16 " + each.grade);
  const auto pictures = render_each_exact(bake.blender_setup, arguments);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const float* p = pictures[i].pixel(8, 8);
    EXPECT_LT(length(Vec3f{p[0], p[1], p[2]} - expected[i].color), expected[i].tolerance) << expected[i].grade;
  }
}

TEST(Blender, NumberedPicturesBecomeAFilmWithPlatesUnderAnUprightEmpty) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  std::vector<bake::Camera> cameras;
  for (const int frame : {3, 4, 7}) {
    cameras.push_back(
        camera_at("images/frame_" + std::to_string(frame) + ".png", {double(frame), 2, 9}, {1, 2, 3}, 8, 8, 9));
    cameras.back().intrinsics.cx = 1 + 0.5 * frame;
    cameras.back().intrinsics.cy = 8 - 0.5 * frame;
  }
  Label label = label_of_first("y", "cm");
  label.world.metres_per_unit = 0.01;
  BakeFolder bake(folder.path(), cameras, label);
  const bake::Volume block = block_volume({0, 0, 0}, {4, 4, 4}, 1);
  bake.add_volumes({planes_of(block)}, "volume", {});
  bake.add_plate(cameras[1].name, make_web_photo(cameras[1].intrinsics, std::vector<float>(64, 0.5f), 8, 90).jpeg);
  bake.finish();
  std::ofstream(folder / "check.py")
      << "import bpy\n"
         "scene = bpy.context.scene\n"
         "root, film = bpy.data.objects['cnerf'], bpy.data.objects['cnerf film']\n"
         "assert scene.camera == film and (scene.frame_start, scene.frame_end) == (3, 7)\n"
         "assert all(o.parent == root for o in scene.objects if o != root)\n"
         "for frame in (3, 4, 7):\n"
         "    scene.frame_set(frame)\n"
         "    at = film.matrix_world.to_translation()\n"  // (x, y, z) stands up as (x, -z, y), in metres
         "    assert max(abs(a - b) for a, b in zip(at, (0.01 * frame, -0.09, 0.02))) < 1e-6, at\n"
         "    shift, right = (film.data.shift_x, film.data.shift_y), {3: (3, 5), 4: (2, 4), 7: (-1, 1)}[frame]\n"
         "    assert max(abs(a - b / 16) for a, b in zip(shift, right)) < 1e-6, (frame, shift)\n"  // in widths
         "plates = [len(o.data.background_images) for o in scene.objects if o.type == 'CAMERA']\n"
         "assert sum(plates) == 1, plates\n";
  EXPECT_EQ(run_blender(bake.blender_setup(), "--film", folder / "check.py"), 0)
      << read_text_file(folder / "blender.log");
}

/// A white ball before black, as a camera with a lens would have photographed it.
std::vector<float> photograph_of_ball(const bake::Camera& camera, Vec3d centre, double radius) {
  const Intrinsics& lens = camera.intrinsics;
  const Vec3d to_centre = centre - camera.world_from_camera.translation;
  std::vector<float> luminance;
  for (int y = 0; y < lens.height; ++y) {
    for (int x = 0; x < lens.width; ++x) {
      const Vec3d d = normalized(camera.world_from_camera.direction(ray_direction(lens, {x + 0.5, y + 0.5})));
      const double along = dot(d, to_centre);
      luminance.push_back(dot(to_centre, to_centre) - along * along < radius * radius ? 1.0f : 0.0f);
    }
  }
  return luminance;
}

/// A lens that bends, pixels that are not square, an axis and a ball off the middle.
TEST(Blender, ThePhotographLiesUnderWhatItShows) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const AnalyticField ball({{0, 0, 0}, 0.5, 1}, sphere_density({0.7f, 0.55f, 0.65f}, 0.12f, 400), 0.6f);
  const Vec3d centre = ball.frame().world_from_unit(Vec3d{0.7, 0.55, 0.65});
  bake::Options options;
  options.voxel_size = 1.0 / 128;  // an opaque ball grows by less than half a voxel
  bake::Camera camera = camera_at("front", {0, -1.6, 0}, {0, 0, 0}, 120, 160, 100);
  camera.intrinsics.fy = 90;
  camera.intrinsics.cx = 52;
  camera.intrinsics.cy = 87.5;
  bake::Camera bent = camera;
  bent.intrinsics.model = LensModel::kOpenCv;
  bent.intrinsics.distortion = {0.8};
  const std::vector<float> photograph = photograph_of_ball(bent, centre, 0.24);
  const bake::Volume volume = bake_volume(ball, {}, options);

  const auto overlap_of = [&](const bake::Camera& shown_as, const std::string& name) {
    BakeFolder bake(folder / name, {shown_as}, label_of_first("y"));
    bake.add_volumes({planes_of(volume)}, "volume", {});
    bake.add_plate("front", make_web_photo(shown_as.intrinsics, photograph, 4096, 95).jpeg);
    bake.finish();
    const auto pictures = render_each_exact(
        bake.blender_setup(), {"--samples 16", "--samples 1 --over-plate 0", "--samples 16 --over-plate 0.5"});
    const RenderedExr &ours = pictures[0], &plate = pictures[1], &half = pictures[2];
    std::size_t both = 0, either = 0;
    for (int y = 0; y < ours.height; ++y) {
      for (int x = 0; x < ours.width; ++x) {
        const bool here = ours.pixel(x, y)[3] > 0.5f, there = plate.pixel(x, y)[1] > 0.5f;
        both += here && there ? 1 : 0;
        either += here || there ? 1 : 0;
        EXPECT_NEAR(half.pixel(x, y)[1],
                    (1 - 0.5f * ours.pixel(x, y)[3]) * plate.pixel(x, y)[1] + 0.5f * ours.pixel(x, y)[1], 0.02f);
      }
    }
    EXPECT_GT(either, 500u);
    return double(both) / double(either);
  };
  EXPECT_GT(overlap_of(bent, "undistorted"), 0.94);  // measured 0.953: the ball grows a little
  EXPECT_LT(overlap_of(camera, "as it is"), 0.9);    // the measure notices the lens
}

/// A script for Blender that has the add-on as `module`, and takes a bake by its operator as `import_bake`.
void write_addon_script(const std::filesystem::path& file, const VolumeExport& bake, const std::string& text) {
  std::ofstream(file) << "import bpy, importlib.util\n"
                      << "spec = importlib.util.spec_from_file_location('cnerf_bake', r'" << bake.blender_setup.string()
                      << "')\n"
                      << "module = importlib.util.module_from_spec(spec)\n"
                      << "spec.loader.exec_module(module)\n"
                      << "import_bake = lambda: bpy.ops.import_scene.cnerf_bake(filepath=r'" << bake.manifest.string()
                      << "')\n"
                      << text;
}

TEST(Blender, TheAddOnImportsABakeIntoASceneOfItsOwn) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const VolumeExport bake = export_volume(block_volume({0, 0, 0}, {4, 4, 4}, 1), {}, folder.path(), "block");
  write_addon_script(folder / "import.py", bake,
                     "assert module.bl_info['category'] == 'Import-Export'\n"
                     "module.register()\n"
                     "assert import_bake() == {'FINISHED'}\n"
                     "assert 'VOLUME' in [o.type for o in bpy.data.scenes['cnerf'].objects]\n"
                     "assert bpy.data.scenes['Scene'].objects\n"
                     "module.unregister()\n");
  EXPECT_EQ(run_blender(folder / "import.py", ""), 0) << read_text_file(folder / "blender.log");
}

TEST(Blender, AFailedImportLeavesNoScene) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const VolumeExport bake = export_volume(block_volume({0, 0, 0}, {4, 4, 4}, 1), {}, folder.path(), "block");
  write_file(bake.vdb, "not a VDB");
  write_addon_script(folder / "import.py", bake,
                     "module.register()\n"
                     "try:\n"
                     "    import_bake()\n"
                     "    assert False\n"
                     "except RuntimeError as refused:\n"  // what an operator reports
                     "    assert 'block.vdb' in str(refused), refused\n"
                     "assert [s.name for s in bpy.data.scenes] == ['Scene']\n"
                     "assert bpy.context.window.scene.name == 'Scene'\n");
  EXPECT_EQ(run_blender(folder / "import.py", ""), 0) << read_text_file(folder / "blender.log");
}

TEST(Blender, AStudiosColourConfigurationIsNoFailure) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const VolumeExport bake = export_volume(block_volume({0, 0, 0}, {4, 4, 4}, 1), {}, folder.path(), "block");
  write_file(folder / "studio.ocio",
             "ocio_profile_version: 1\n\n"
             "roles:\n"
             "  data: linear\n  default: linear\n  default_float: linear\n  reference: linear\n"
             "  scene_linear: linear\n  color_picking: shown\n  default_byte: shown\n  default_sequencer: shown\n"
             "  texture_paint: shown\n\n"
             "displays:\n  studio:\n    - !<View> {name: graded, colorspace: shown}\n\n"
             "active_displays: [studio]\nactive_views: [graded]\n\n"
             "colorspaces:\n"
             "  - !<ColorSpace>\n    name: linear\n    bitdepth: 32f\n\n"
             "  - !<ColorSpace>\n    name: shown\n    bitdepth: 32f\n"
             "    to_reference: !<ExponentTransform> {value: [2.2, 2.2, 2.2, 1]}\n");
  ::setenv("OCIO", (folder / "studio.ocio").c_str(), 1);
  const int status = run_blender(bake.blender_setup, "");
  ::unsetenv("OCIO");
  const std::string log = read_text_file(folder / "blender.log");
  EXPECT_EQ(status, 0) << log;
  EXPECT_NE(log.find("no display_device sRGB and no view_transform Standard"), std::string::npos) << log;
  EXPECT_NE(log.find("shown by studio, graded"), std::string::npos) << log;
}

TEST(Blender, TheAddOnIsInstalledByBlendersOwnInstaller) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const VolumeExport bake = export_volume(block_volume({0, 0, 0}, {4, 4, 4}, 1), {}, folder.path(), "block");
  std::filesystem::create_directories(folder / "scripts/addons");
  ::setenv("BLENDER_USER_SCRIPTS", (folder / "scripts").c_str(), 1);  // not the tester's own
  std::ofstream(folder / "install.py") << "import bpy\n"
                                          "bpy.ops.preferences.addon_install(filepath=r'" CNERF_ADDON_ZIP
                                          "')\n"
                                          "bpy.ops.preferences.addon_enable(module='cnerf_bake')\n"
                                          "assert 'cnerf_bake' in bpy.context.preferences.addons\n"
                                          "assert bpy.ops.import_scene.cnerf_bake(filepath=r'" +
                                              bake.manifest.string() +
                                              "') == {'FINISHED'}\n"
                                              "assert 'VOLUME' in [o.type for o in bpy.data.scenes['cnerf'].objects]\n";
  EXPECT_EQ(run_blender(folder / "install.py", ""), 0) << read_text_file(folder / "blender.log");
  EXPECT_TRUE(std::filesystem::exists(folder / "scripts/addons/cnerf_bake/__init__.py"));
  ::unsetenv("BLENDER_USER_SCRIPTS");
}

/// Python that runs a set-up as Blender does where it has a window.
std::string in_a_window(const std::filesystem::path& setup, const std::string& globals) {
  return "import bpy, sys\nfile = r'" + setup.string() +
         "'\n"
         "text = open(file, encoding='utf-8').read().replace('bpy.app.background', 'False')\n"
         "before = [o.name for o in bpy.data.scenes['Scene'].objects]\n"
         "exec(compile(text, file, 'exec'), {'__name__': '__main__'" +
         globals +
         "})\n"
         "scene = bpy.data.scenes['cnerf']\n";
}

TEST(Blender, PastedIntoTheTextEditorItMakesASceneOfItsOwn) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const VolumeExport bake = export_volume(block_volume({0, 0, 0}, {4, 4, 4}, 1), {}, folder / "ü and 😀", "block");
  // No __file__ and no file of the text: only the folder in the script is left. A scene that must not be touched.
  std::ofstream(folder / "paste.py")
      << in_a_window(bake.blender_setup, "")
      << "assert before and before == [o.name for o in bpy.data.scenes['Scene'].objects]\n"
         "assert bpy.context.window.scene == scene\n"
         "assert sorted(o.type for o in scene.objects) == ['CAMERA', 'EMPTY', 'VOLUME']\n"
         "volume = [o.data for o in scene.objects if o.type == 'VOLUME'][0]\n"
         "volume.grids.load()\n"
         "assert 'density' in [g.name for g in volume.grids]\n";
  EXPECT_EQ(run_blender(folder / "paste.py", ""), 0) << read_text_file(folder / "blender.log");
}

TEST(Blender, TheTextEditorShowsTheBakeBesideTheOpenText) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  export_volume(block_volume({0, 0, 0}, {4, 4, 4}, 1), {}, folder / "original", "block");
  std::filesystem::copy(folder / "original", folder / "copy", std::filesystem::copy_options::recursive);
  const std::filesystem::path setup = folder / "copy" / "blender_setup.py";
  // Without a window there is no text editor: a stand-in has its text open. Its __file__ is the name of the text.
  std::ofstream(folder / "editor.py") << "import bpy, os, types\n"
                                         "class Editor:\n"
                                         "    real = bpy.context\n"
                                         "    space_data = types.SimpleNamespace(text=bpy.data.texts.load(r'" +
                                             setup.string() +
                                             "'))\n"
                                             "    def __getattr__(self, name):\n"
                                             "        return getattr(self.real, name)\n"
                                             "bpy.context = Editor()\n" +
                                             in_a_window(setup, ", '__file__': '/blender_setup.py'") +
                                             "volume = [o.data for o in scene.objects if o.type == 'VOLUME'][0]\n"
                                             "assert os.path.samefile(os.path.dirname(volume.filepath), r'" +
                                             (folder / "copy").string() + "'), volume.filepath\n";
  EXPECT_EQ(run_blender(folder / "editor.py", ""), 0) << read_text_file(folder / "blender.log");
}

TEST(Blender, OptionsAreTakenWhereThereIsAWindow) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const VolumeExport bake = export_volume(block_volume({0, 0, 0}, {4, 4, 4}, 1), {}, folder.path(), "block");
  std::ofstream(folder / "windowed.py") << in_a_window(bake.blender_setup, ", '__file__': file")
                                        << "assert scene.cycles.samples == 7\n";
  EXPECT_EQ(run_blender(folder / "windowed.py", "--samples 7"), 0) << read_text_file(folder / "blender.log");
}

TEST(Blender, FailuresEndWithAnExitStatus) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const VolumeExport bake = export_volume(block_volume({0, 0, 0}, {4, 4, 4}, 1), {}, folder.path(), "block");
  EXPECT_NE(run_blender(bake.blender_setup, "--camera 7"), 0);
  EXPECT_NE(run_blender(bake.blender_setup, "--manifest /nowhere/manifest.json"), 0);
  EXPECT_NE(run_blender(bake.blender_setup, "--over-plate 1"), 0) << "there is no photograph";
  EXPECT_EQ(run_blender(bake.blender_setup, "--save '" + (folder / "scene.blend").string() + "'"), 0)
      << read_text_file(folder / "blender.log");
  EXPECT_TRUE(std::filesystem::exists(folder / "scene.blend"));
}

TEST(Blender, AVolumeThatCannotBeReadIsRefusedByName) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const bake::Volume coarse = block_volume({0, 0, 0}, {6, 6, 6}, 1, 0.1), fine = block_volume({0, 0, 0}, {4, 4, 4}, 2);
  BakeFolder bake(folder.path(), {}, label_of_first());
  bake.add_volumes({planes_of(fine), planes_of(coarse)}, "volume", {});
  bake.finish();
  const auto expect_refusal_of = [&](const std::string& file) {
    EXPECT_EQ(run_blender(bake.blender_setup(), ""), 1) << file;
    const std::string log = read_text_file(folder / "blender.log");
    EXPECT_NE(log.find("/" + file + ": "), std::string::npos) << log;
  };
  write_file(folder / "volume.vdb", "not a VDB");
  expect_refusal_of("volume.vdb");
  std::filesystem::remove(folder / "volume_fine1.vdb");
  expect_refusal_of("volume_fine1.vdb");
}

}  // namespace
}  // namespace cnerf::exporting::test
