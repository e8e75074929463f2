/// Colours of texels: what the field shows there, not what it holds at one point.

#include <gtest/gtest.h>

#include "bake/density/density_pass.h"
#include "bake/mesh/texture/texture_baker.h"
#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/mesh/test_surfaces.h"
#include "tests/bake/whole_bake.h"

namespace cnerf::bake::test {
namespace {

const SceneFrame kMeshFrame{{1, 2, 3}, 0.5, 1};  // world box: 2 units around (1, 2, 3)
constexpr Vec3f kMeshMiddle{0.5f, 0.5f, 0.5f};

/// Colour that changes with the direction from the middle.
Vec3f sphere_color(Vec3f unit) {
  const Vec3f d = normalized(unit - kMeshMiddle);
  return {0.4f + 0.25f * d.x, 0.4f + 0.2f * d.y, 0.4f + 0.2f * d.z};
}

AnalyticField coloured_sphere() {
  AnalyticField field(kMeshFrame, sphere_density(kMeshMiddle, 0.3f, 600));
  field.with_luminance([](Vec3f p, Vec3f) { return relative_xyz_from_linear_rgb(sphere_color(p)).y; });
  field.with_chromaticity([](Vec3f p) {
    const Vec3f xyz = relative_xyz_from_linear_rgb(sphere_color(p));
    return Chromaticity{xyz.x / xyz.y, xyz.z / xyz.y};
  });
  return field;
}

Options coarse() {
  Options options;
  options.resolution = 48;
  return options;
}

MeshOptions small_texture() {
  MeshOptions options;
  options.faces = 2000;
  options.texture_size = 256;
  return options;
}

std::vector<Camera> cameras_around() {
  std::vector<Camera> cameras;
  for (const Vec3d eye :
       {Vec3d{6, 2, 3}, Vec3d{-4, 2, 3}, Vec3d{1, 7, 3}, Vec3d{1, -3, 3}, Vec3d{1, 2, 8}, Vec3d{1, 2, -2}}) {
    cameras.push_back(camera_at("view", eye, {1, 2, 3}, 64, 64, 100));
  }
  return cameras;
}

TEST(MeshBake, ASphereWearsItsColours) {
  const AnalyticField field = coloured_sphere();
  for (const bool with_cameras : {false, true}) {
    const Mesh mesh =
        bake_mesh(field, with_cameras ? cameras_around() : std::vector<Camera>{}, coarse(), small_texture());
    const Texture& texture = mesh.texture;
    ASSERT_EQ(mesh.positions.size(), mesh.uvs.size());
    double worst = 0;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
      EXPECT_NEAR(length(mesh.positions[v] - Vec3f{1, 2, 3}), 0.6, 0.02) << "world units";
      const int x = int(mesh.uvs[v].u * texture.size), y = int(mesh.uvs[v].v * texture.size);
      const Vec3f color = texture.rgb[std::size_t(y) * texture.size + x];
      const Vec3f expected = sphere_color(kMeshFrame.unit_from_world(mesh.positions[v].cast<double>()).cast<float>());
      for (int c = 0; c < 3; ++c) worst = std::max<double>(worst, std::abs(color[c] - expected[c]));
    }
    EXPECT_LT(worst, 0.03) << "within a texel's way";
    for (std::size_t i = 0; i < texture.rgb.size(); ++i) {
      const Lab<float> lab = lab_from_linear_rgb(texture.rgb[i]);
      ASSERT_NEAR(lab.a, texture.a[i], 1e-3);
      ASSERT_NEAR(luminance_of(texture.rgb[i]), texture.luminance[i], 1e-5);
    }
  }
}

TEST(MeshBake, DoesNotDependOnThreads) {
  const AnalyticField field = coloured_sphere();
  set_thread_count(1);
  const Mesh one = bake_mesh(field, cameras_around(), coarse(), small_texture());
  set_thread_count(3);
  const Mesh three = bake_mesh(field, cameras_around(), coarse(), small_texture());
  set_thread_count(0);
  EXPECT_EQ(one.positions, three.positions);
  EXPECT_EQ(one.triangles, three.triangles);
  EXPECT_EQ(one.texture.rgb, three.texture.rgb);
}

TEST(MeshBake, GreyHasNoColourAtAll) {
  const AnalyticField field(kMeshFrame, sphere_density(kMeshMiddle, 0.3f, 600), 0.37f);
  const Mesh mesh = bake_mesh(field, cameras_around(), coarse(), small_texture());
  for (std::size_t i = 0; i < mesh.texture.rgb.size(); ++i) {
    ASSERT_EQ(mesh.texture.a[i], 0);
    ASSERT_EQ(mesh.texture.b[i], 0);
    ASSERT_NEAR(mesh.texture.luminance[i], 0.37, 1e-5) << "also where it is filled in";
  }
}

TEST(MeshBake, NothingOpaqueIsAnInputError) {
  const AnalyticField fog(kMeshFrame, sphere_density(kMeshMiddle, 0.3f, 1));
  EXPECT_THROW((void)bake_mesh(fog, {}, coarse(), small_texture()), InputError);
}

/// What TexelShader needs of a bake.
struct Stage {
  explicit Stage(const AnalyticField& field)
      : plan(plan_bake(field, coarse())), sigma(bake_density(field, plan, coarse(), [](double) {})) {}
  Plan plan;
  BrickGrid<float> sigma;
};

TEST(TexelShader, FindsTheSurfaceFromALittleOff) {
  const AnalyticField field = coloured_sphere();
  const Stage stage(field);
  const TexelShader shader(field, {}, stage.plan, coarse(), stage.sigma);
  const Vec3f direction = normalized(Vec3f{1, -2, 0.5f});
  const Vec3f expected = sphere_color(kMeshMiddle + direction * 0.3f);
  std::vector<SurfacePoint> points;
  for (const float off :
       {-1.5f, -0.5f, 0.0f, 0.5f, 1.5f}) {  // voxels; one sample at the point would miss three of them
    const Vec3d world = kMeshFrame.world_from_unit((kMeshMiddle + direction * 0.3f).cast<double>());
    const Vec3f voxel = ((world - stage.plan.origin) / stage.plan.voxel_size).cast<float>();
    points.push_back({voxel + direction * off, direction});
  }
  for (const SurfaceColor& color : shader.shade(points)) {
    EXPECT_GT(color.opacity, 0.95f);
    EXPECT_NEAR(color.luminance, luminance_of(expected), 2e-3);
  }
  const SurfaceColor empty = shader.shade(std::vector<SurfacePoint>{{{2, 2, 2}, {0, 0, 1}}})[0];
  EXPECT_EQ(empty.opacity, 0);
}

TEST(TexelShader, AveragesOverTheViewsThatSeeThePoint) {
  AnalyticField field(kMeshFrame, sphere_density(kMeshMiddle, 0.3f, 600));
  field.with_luminance([](Vec3f, Vec3f d) { return d.x < -0.5f ? 0.2f : d.y < -0.5f ? 0.6f : 9.0f; });
  const Stage stage(field);
  const std::vector<Camera> cameras{camera_at("x", {6, 2, 3}, {1, 2, 3}, 64, 64, 100),
                                    camera_at("y", {1, 7, 3}, {1, 2, 3}, 64, 64, 100),
                                    camera_at("hidden", {1, -3, 3}, {1, 2, 3}, 64, 64, 100)};
  const TexelShader shader(field, cameras, stage.plan, coarse(), stage.sigma);
  const auto at = [&](Vec3f direction) {
    const Vec3d world = kMeshFrame.world_from_unit((kMeshMiddle + direction * 0.3f).cast<double>());
    return SurfacePoint{((world - stage.plan.origin) / stage.plan.voxel_size).cast<float>(), direction};
  };
  const auto colors =
      shader.shade(std::vector<SurfacePoint>{at({1, 0, 0}), at({0, 1, 0}), at(normalized(Vec3f{1, 1, 0}))});
  EXPECT_NEAR(colors[0].luminance, 0.2, 0.02) << "one camera looks at it squarely";
  EXPECT_NEAR(colors[1].luminance, 0.6, 0.02);
  EXPECT_NEAR(colors[2].luminance, 0.4, 0.01) << "both see it alike";
}

TEST(FillIn, ColoursReachOverTheGutterAndTheRestIsTheirMean) {
  Texture texture;
  texture.size = 16;
  texture.rgb.resize(256);
  texture.coverage.resize(256);
  for (auto* map : {&texture.luminance, &texture.a, &texture.b}) map->resize(256);
  const auto at = [](int x, int y) { return std::size_t(y) * 16 + x; };
  texture.rgb[at(3, 3)] = {1, 0, 0};
  texture.rgb[at(12, 12)] = {0, 0, 1};
  texture.coverage[at(3, 3)] = texture.coverage[at(12, 12)] = 1;
  fill_in(texture, 2);
  EXPECT_EQ(texture.rgb[at(5, 1)], (Vec3f{1, 0, 0}));
  EXPECT_EQ(texture.rgb[at(14, 14)], (Vec3f{0, 0, 1}));
  EXPECT_EQ(texture.rgb[at(6, 3)], (Vec3f{0.5f, 0, 0.5f})) << "three texels away";
  EXPECT_NEAR(texture.a[at(5, 1)], 80.09, 0.05) << "Lab of red";
  EXPECT_EQ(texture.coverage[at(5, 1)], 0);
}

}  // namespace
}  // namespace cnerf::bake::test
