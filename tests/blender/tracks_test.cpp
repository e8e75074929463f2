/// Blender reads the cameras of a bake by its own importers: the Nuke add-on that it ships, and USD where it was built
/// with that.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "export/camera_tracks.h"
#include "src/base/files.h"
#include "tests/bake/analytic_field.h"
#include "tests/blender/blender_run.h"
#include "tests/export/test_volumes.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
using bake::test::camera_at;
namespace {

constexpr int kMissing = 77;

/// Square pixels; a zoom, and a principal point off the middle.
std::vector<bake::Camera> shot() {
  std::vector<bake::Camera> cameras;
  for (const int frame : {3, 4, 7}) {
    cameras.push_back(
        camera_at("shot_" + std::to_string(frame) + ".png", {2.0 + frame, -3, 1.5}, {0, 0, 0}, 64, 48, 70.0 + frame));
    cameras.back().intrinsics.cx += 5;
  }
  return cameras;
}

/// {frame: (4 rows of the matrix, focal length in widths of the sensor)}: Blender is Z-up and looks along -Z.
std::string python_truth(const std::vector<bake::Camera>& cameras) {
  std::string text = "TRUTH = {\n";
  for (const bake::Camera& camera : cameras) {
    text += camera.name.substr(5, 1) + ": ([";
    for (int row = 0; row < 3; ++row) {
      const Vec3d& r = camera.world_from_camera.linear.rows[row];
      text += fmt::format("[{}, {}, {}, {}], ", r.x, -r.y, -r.z, camera.world_from_camera.translation[row]);
    }
    text += fmt::format("[0, 0, 0, 1]], {}),\n", camera.intrinsics.fx / camera.intrinsics.width);
  }
  return text + "}\n";
}

const char* const kCompare =
    "def compare(camera, scene):\n"
    "    for frame, (rows, lens) in TRUTH.items():\n"
    "        scene.frame_set(frame)\n"
    "        found = camera.matrix_world\n"
    "        for i in range(4):\n"
    "            for j in range(4):\n"
    "                assert abs(found[i][j] - rows[i][j]) < 1e-5, (frame, found, rows)\n"
    "        found = camera.data.lens / camera.data.sensor_width\n"
    "        assert abs(found - lens) < 1e-4 * lens, (frame, found, lens)\n";

TEST(BlenderTracks, TheNukeImporterPlacesTheCamera) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  write_chan(shot(), label_of_first("z").world, folder / "cameras.chan");
  std::ofstream(folder / "import.py") << "import bpy, addon_utils, math, sys\n"
                                      << python_truth(shot()) << kCompare
                                      << "if addon_utils.enable('io_anim_nuke_chan') is None:\n    sys.exit("
                                      << kMissing << ")\n"
                                      << "scene = bpy.context.scene\n"
                                         "bpy.ops.object.camera_add()\n"
                                         "camera = bpy.context.active_object\n"
                                         "bpy.ops.import_scene.import_chan(filepath=r'"
                                      << (folder / "cameras.chan").string()
                                      << "', rotation_order='ZXY', z_up=True, sensor_width=36, sensor_height=27)\n"
                                         "compare(camera, scene)\n";
  const int status = run_blender(folder / "import.py", "");
  if (status == kMissing) GTEST_SKIP() << "this Blender has no importer of .chan files";
  EXPECT_EQ(status, 0) << read_text_file(folder / "blender.log");
}

TEST(BlenderTracks, TheUsdImporterPlacesTheCameras) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  write_cameras_usd(shot(), {}, label_of_first("z"), folder / "cameras.usda");
  std::ofstream(folder / "import.py") << "import bpy, sys\n"
                                      << python_truth(shot()) << kCompare
                                      << "if not bpy.app.build_options.usd:\n    sys.exit(" << kMissing << ")\n"
                                      << "bpy.ops.wm.read_factory_settings(use_empty=True)\n"
                                         "bpy.ops.wm.usd_import(filepath=r'"
                                      << (folder / "cameras.usda").string()
                                      << "')\n"
                                         "scene = bpy.context.scene\n"
                                         "cameras = {o.name: o for o in scene.objects if o.type == 'CAMERA'}\n"
                                         "assert len(cameras) == 4, cameras\n"
                                         "if bpy.app.version < (4, 1, 0):\n"  // it knows no sensor of USD's
                                         "    sys.exit(0)\n"
                                         "compare(cameras['shot'], scene)\n"
                                         "still = cameras['camera_shot_4'].data\n"
                                         "lens = still.lens / still.sensor_width\n"
                                         "assert abs(lens - TRUTH[4][1]) < 1e-4, lens\n"
                                         "assert abs(still.sensor_width - 36) < 1e-3, still.sensor_width\n"
                                         "assert abs(still.shift_x + 5 / 64) < 1e-5, still.shift_x\n";
  const int status = run_blender(folder / "import.py", "");
  if (status == kMissing) GTEST_SKIP() << "this Blender was built without USD, as Debian 12's is";
  EXPECT_EQ(status, 0) << read_text_file(folder / "blender.log");
}

}  // namespace
}  // namespace cnerf::exporting::test
