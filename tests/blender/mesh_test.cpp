/// Volume and mesh of one field, side by side in the real Blender.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <tuple>
#include <utility>

#include "export/bake_folder.h"
#include "src/base/files.h"
#include "src/color/colorspace_math.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/whole_bake.h"
#include "tests/blender/blender_run.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
using namespace bake::test;
namespace {

/// An L of a box and a ball: nothing about it is symmetric, and each half has its own colour.
AnalyticField l_shape() {
  const auto is_ball = [](Vec3f p) { return length(p - Vec3f{0.62f, 0.5f, 0.42f}) < 0.13f; };
  const auto is_box = [](Vec3f p) { return Aabbf{{0.3f, 0.4f, 0.35f}, {0.5f, 0.55f, 0.72f}}.contains(p); };
  AnalyticField field({{2, -1, 0.5}, 0.5, 1}, [=](Vec3f p) { return is_ball(p) || is_box(p) ? 500.0f : 0.0f; });
  const auto xyz = [](Vec3f p) {
    return relative_xyz_from_linear_rgb(p.x > 0.5f ? Vec3f{0.7f, 0.2f, 0.1f} : Vec3f{0.1f, 0.4f, 0.6f});
  };
  field.with_luminance([xyz](Vec3f p, Vec3f) { return xyz(p).y; });
  field.with_chromaticity([xyz](Vec3f p) { return Chromaticity{xyz(p).x / xyz(p).y, xyz(p).z / xyz(p).y}; });
  return field;
}

struct Silhouettes {
  double iou = 0;         ///< of pixels more than half covered
  double difference = 0;  ///< root mean square of linear RGB where both cover
  std::size_t pixels = 0;
};

Silhouettes compare_silhouettes(const RenderedExr& volume, const RenderedExr& mesh) {
  std::size_t both = 0, either = 0;
  double squared = 0;
  for (int y = 0; y < volume.height; ++y) {
    for (int x = 0; x < volume.width; ++x) {
      const float *v = volume.pixel(x, y), *m = mesh.pixel(x, y);
      either += v[3] > 0.5f || m[3] > 0.5f ? 1 : 0;
      if (v[3] < 0.99f || m[3] < 0.99f) {
        both += v[3] > 0.5f && m[3] > 0.5f ? 1 : 0;
        continue;
      }
      ++both;
      for (int c = 0; c < 3; ++c) squared += std::pow(double(v[c]) - m[c], 2) / 3;
    }
  }
  return {double(both) / double(either), std::sqrt(squared / double(both)), either};
}

/// The axis that points up, metres in a unit.
class MeshBesideVolume : public testing::TestWithParam<std::pair<const char*, double>> {};

TEST_P(MeshBesideVolume, SilhouettesAndColoursAgree) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const AnalyticField field = l_shape();
  const std::vector<bake::Camera> cameras{camera_at("a", {5.2, -4.4, 2.1}, {2, -1, 0.5}, 160, 120, 330),
                                          camera_at("b", {-0.5, 1.9, 3.2}, {2, -1, 0.5}, 160, 120, 330)};
  bake::Options options;
  options.resolution = 128;  // interpolation widens an opaque volume by about half a voxel all around, a mesh not
  bake::MeshOptions mesh_options;
  mesh_options.faces = 12000;
  mesh_options.texture_size = 512;
  Label label;
  // Turn and scale the glTF, and must not part what Blender shows.
  std::tie(label.world.up_axis, label.world.metres_per_unit) = GetParam();
  BakeFolder bake(folder.path(), cameras, label);
  const bake::Volume baked = bake_volume(field, cameras, options);
  bake.add_volumes({planes_of(baked)}, "volume", {});
  bake.add_mesh(bake_mesh(field, cameras, options, mesh_options), "mesh", true);
  bake.finish();
  const std::vector<std::string> names = {"a", "b"};
  std::vector<std::string> arguments;
  for (const std::string& name : names) {
    arguments.push_back("--samples 16 --camera " + name);
    arguments.push_back("--samples 16 --mesh only --camera " + name);
  }
  const auto pictures = render_each_exact(bake.blender_setup(), arguments);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Silhouettes equal = compare_silhouettes(pictures[2 * i], pictures[2 * i + 1]);  // volume, mesh
    std::printf("volume against mesh, camera %s: IoU %.4f, colours differ by %.4f\n", names[i].c_str(), equal.iou,
                equal.difference);
    EXPECT_GT(equal.pixels, 1500u);
    EXPECT_GE(equal.iou, 0.95);
    EXPECT_LT(equal.difference, 0.03);
  }
}
INSTANTIATE_TEST_SUITE_P(UpAxis, MeshBesideVolume, testing::Values(std::pair("z", 1.0), std::pair("y", 0.5)));

TEST(BlenderMesh, UsesOfTheMesh) {
  CNERF_REQUIRE_BLENDER();
  const TempDir folder;
  const AnalyticField field = l_shape();
  bake::Options options;
  options.resolution = 32;
  bake::MeshOptions mesh_options;
  mesh_options.faces = 1000;
  mesh_options.texture_size = 128;
  BakeFolder bake(folder.path(), {camera_at("a", {5, -4, 2}, {2, -1, 0.5}, 64, 48, 130)}, {});
  bake.add_mesh(bake_mesh(field, {}, options, mesh_options), "mesh", true);
  bake.finish();
  std::ofstream(folder / "check.py")
      << "import bpy\n"
         "objects = bpy.data.objects\n"
         "assert sorted(o.type for o in objects) == ['CAMERA', 'EMPTY', 'MESH'], [o.type for o in objects]\n"
         "mesh = objects['cnerf mesh']\n"
         "assert mesh.parent == objects['cnerf'] and not mesh.hide_render and mesh.is_holdout\n"
         "corners = [mesh.matrix_world @ v.co for v in mesh.data.vertices]\n"
         "low = [min(c[i] for c in corners) for i in range(3)]\n"
         "expected = (2 + (0.3 - 0.5) * 2, -1 + (0.37 - 0.5) * 2, 0.5 + (0.29 - 0.5) * 2)\n"
         "assert max(abs(a - b) for a, b in zip(low, expected)) < 0.04, low\n";
  EXPECT_EQ(run_blender(bake.blender_setup(), "--mesh holdout", folder / "check.py"), 0)
      << read_text_file(folder / "blender.log");
}

}  // namespace
}  // namespace cnerf::exporting::test
