/// The sky of a bake as Blender's world: every direction has its colour, whatever axis points up in the poses.

#include <gtest/gtest.h>

#include <cmath>

#include "export/bake_folder.h"
#include "src/base/files.h"
#include "src/render/direction_map.h"
#include "tests/bake/analytic_field.h"
#include "tests/blender/blender_run.h"
#include "tests/export/test_volumes.h"
#include "tests/export/whole_export.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
using namespace bake::test;
namespace {

Vec3f color_along(Vec3f direction) {
  return {0.5f + 0.4f * direction.x, 0.5f + 0.4f * direction.y, 0.5f + 0.4f * direction.z};
}

SkyPicture smooth_sky() {
  SkyPicture sky{256, 128, {}};
  for (int y = 0; y < sky.height; ++y) {
    for (int x = 0; x < sky.width; ++x) {
      const SkyPlace place{(float(x) + 0.5f) / float(sky.width), 1 - (float(y) + 0.5f) / float(sky.height)};
      const Vec3f rgb = color_along(sky_direction(place));
      sky.rgb.insert(sky.rgb.end(), {rgb.x, rgb.y, rgb.z});
    }
  }
  return sky;
}

class BlenderSky : public testing::TestWithParam<const char*> {};

TEST_P(BlenderSky, StandsWhereTheFieldHasIt) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const bake::Volume volume = block_volume({0, 0, 0}, {4, 4, 4}, 1.0f);
  const Vec3d eye = {4, 5, 6};
  const std::vector<Vec3d> directions = {{1, 0, 0}, {0, 1, 0.1}, {-0.5, -1, 0.4}, {0.2, 0.3, 0.9}};
  std::vector<bake::Camera> cameras;
  for (std::size_t i = 0; i < directions.size(); ++i) {
    cameras.push_back(camera_at("camera" + std::to_string(i), eye, eye + directions[i], 33, 25, 40));
  }
  BakeFolder bake(folder.path(), cameras, label_of_first(GetParam()));
  bake.add_sky(smooth_sky());
  bake.add_volumes({dilated(planes_of(volume), 2)}, "volume", {});
  bake.finish();
  EXPECT_EQ(read_manifest(bake.manifest()).sky.value().file, "sky.exr");

  const auto images =
      render_cameras(bake.blender_setup(), "--samples 16", {"camera0", "camera1", "camera2", "camera3"});
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const RenderedExr& image = images[c];
    for (const auto& [x, y] : {std::pair{16, 12}, {2, 2}, {30, 3}, {3, 22}}) {
      const Vec3d ray = ray_direction(cameras[c].intrinsics, {x + 0.5, y + 0.5});
      const Vec3f wanted = color_along(normalized(cameras[c].world_from_camera.direction(ray)).cast<float>());
      for (int channel = 0; channel < 3; ++channel) {
        EXPECT_NEAR(image.pixel(x, y)[channel], wanted[channel], 0.012f) << c << ": " << x << ", " << y;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(UpAxis, BlenderSky, testing::Values("x", "y", "z"), [](const auto& up) { return up.param; });

}  // namespace
}  // namespace cnerf::exporting::test
