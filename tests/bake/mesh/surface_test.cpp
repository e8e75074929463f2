/// From voxels to a surface worth texturing.

#include <gtest/gtest.h>

#include <numbers>

#include "bake/mesh/surface/isosurface.h"
#include "bake/mesh/surface/surface_mesh.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/mesh/test_surfaces.h"

namespace cnerf::bake::test {
namespace {

double ball_volume(double radius) {
  return 4.0 / 3 * std::numbers::pi * radius * radius * radius;
}

TEST(Isosurface, ASphereIsClosedFacesOutwardAndHasItsSize) {
  for (const double adaptivity : {0.0, 0.02, 0.2}) {
    const SurfaceMesh mesh = sphere_surface(40, 14, adaptivity);
    ASSERT_GT(mesh.triangles.size(), 300u);
    EXPECT_TRUE(is_closed(mesh)) << adaptivity;
    EXPECT_NEAR(signed_volume(mesh) / ball_volume(14), 1, adaptivity > 0.1 ? 0.03 : 0.01) << adaptivity;
    for (const Vec3f& p : mesh.positions) {
      EXPECT_NEAR(length(p - Vec3f{20, 20, 20}), 14, adaptivity > 0.1 ? 0.4 : 0.15);
    }
    const std::vector<Vec3f> normals = vertex_normals(mesh);
    for (std::size_t v = 0; v < normals.size(); ++v) {
      EXPECT_GT(dot(normals[v], normalized(mesh.positions[v] - Vec3f{20, 20, 20})), adaptivity > 0.1 ? 0.8f : 0.95f);
    }
  }
}

TEST(Isosurface, APartlyCoveredVoxelPutsTheFaceWhereItIs) {
  for (const double wall : {8.0, 8.25, 8.5, 8.9}) {
    const auto slab = inside_of([=](Vec3d p) {
      return std::max({4.0 - p.x, p.x - wall, 4.0 - p.y, p.y - 20.0, 4.0 - p.z, p.z - 20.0});
    });
    const SurfaceMesh mesh = extract_surface(covered_voxels({24, 24, 24}, slab), 1, 1, 0);
    for (const Vec3f& p : mesh.positions) {
      const bool is_on_wall = p.x > 7 && p.y > 6 && p.y < 18 && p.z > 6 && p.z < 18;
      if (!is_on_wall) continue;
      EXPECT_NEAR(p.x, wall, 0.13) << wall;  // of linear interpolation between saturated voxels
    }
  }
}

TEST(Isosurface, DeeperMatterLiesFurtherOut) {
  const auto fog = [](Vec3d p) { return std::max(0.0, 0.5 - 0.05 * length(p - Vec3d{16, 16, 16})); };
  const BrickGrid<float> sigma = covered_voxels({32, 32, 32}, fog);
  EXPECT_GT(signed_volume(extract_surface(sigma, 1, 4, 0)), 2 * signed_volume(extract_surface(sigma, 1, 1.5, 0)));
  EXPECT_TRUE(extract_surface(sigma, 1, 0.5, 0).triangles.empty()) << "nothing halves the light within half a voxel";
}

TEST(Refine, LoosePartsAndCavitiesGo) {
  const auto ball = [](Vec3d p, Vec3d centre, double radius) { return length(p - centre) - radius; };
  const auto shape = inside_of([=](Vec3d p) {
    const double shell = std::max(ball(p, {24, 24, 24}, 14), -ball(p, {24, 24, 24}, 8));
    return std::min({shell, ball(p, {5, 5, 5}, 1.5), ball(p, {42, 42, 42}, 2)});
  });
  const SurfaceMesh mesh = extract_surface(covered_voxels({48, 48, 48}, shape), 1, 1, 0);
  EXPECT_EQ(connected_parts(mesh).size(), 4u) << "outside, cavity and two floaters";
  const SurfaceMesh kept = without_loose_parts(mesh, 0.1);
  EXPECT_EQ(connected_parts(kept).size(), 1u);
  EXPECT_NEAR(signed_volume(kept) / ball_volume(14), 1, 0.01);
  EXPECT_EQ(connected_parts(without_loose_parts(mesh, 0)).size(), 3u) << "the cavity goes whatever the size";
}

TEST(Refine, OfARoomTheInsideStaysWhereCamerasAre) {
  const auto ball = [](Vec3d p, Vec3d centre, double radius) { return length(p - centre) - radius; };
  const auto shape = inside_of([=](Vec3d p) {
    const double walls = std::max(ball(p, {24, 24, 24}, 20), -ball(p, {24, 24, 24}, 15));
    return std::min(walls, ball(p, {24, 24, 24}, 4));
  });
  const SurfaceMesh mesh = extract_surface(covered_voxels({48, 48, 48}, shape), 1, 1, 0);
  EXPECT_EQ(connected_parts(mesh).size(), 3u) << "outside, inside, and what stands there";
  const std::vector<Vec3f> within{{24, 24, 34}, {14, 24, 24}}, outside{{24, 24, 90}}, both{within[0], outside[0]};
  const auto volume_seen_from = [&](const std::vector<Vec3f>& cameras) {
    return signed_volume(without_loose_parts(mesh, 0.1, cameras));
  };
  const double room = -ball_volume(15), hull = ball_volume(20), thing = ball_volume(4);
  EXPECT_NEAR(volume_seen_from(within), room + thing, 0.01 * ball_volume(15));
  EXPECT_NEAR(volume_seen_from(outside), hull + thing, 0.01 * hull);
  EXPECT_NEAR(volume_seen_from(both), hull + room + thing, 0.02 * hull);
}

TEST(Refine, SmoothingKeepsTheVolumeAndDecimationTheShape) {
  SurfaceMesh mesh = sphere_surface(64, 24);
  smooth(mesh, 10);
  EXPECT_NEAR(signed_volume(mesh) / ball_volume(24), 1, 0.01);
  const SurfaceMesh small = decimated(mesh, 1000);
  EXPECT_LE(small.triangles.size(), 1000u);
  EXPECT_GT(small.triangles.size(), 900u);
  EXPECT_TRUE(is_closed(small));
  EXPECT_NEAR(signed_volume(small) / ball_volume(24), 1, 0.02);
  EXPECT_EQ(decimated(small, 5000).triangles.size(), small.triangles.size()) << "nothing to do";
}

TEST(Solidify, HiddenDebrisIsFilledAndOpenSpaceIsNot) {
  // A hollow box with debris inside, and a roof on a pillar: below the roof it is dark, but open to the sides.
  const auto shape = [](Vec3d p) {
    const bool in_box = p.x > 6 && p.x < 22 && p.y > 6 && p.y < 22 && p.z > 6 && p.z < 22;
    const bool in_hollow = p.x > 9 && p.x < 19 && p.y > 9 && p.y < 19 && p.z > 9 && p.z < 19;
    const bool is_debris = in_hollow && (int(p.x) + int(p.y) + int(p.z)) % 3 == 0;
    const bool is_roof = p.x > 28 && p.x < 42 && p.y > 6 && p.y < 22 && p.z > 18 && p.z < 21;
    return (in_box && !in_hollow) || is_debris || is_roof ? 1.0 : 0.0;
  };
  const BrickGrid<float> sigma = covered_voxels({48, 28, 28}, shape);
  Plan plan;
  plan.voxel_size = 1;
  plan.resolution = sigma.size();
  const std::vector<Camera> cameras{camera_at("above", {24, 14, 200}, {24, 14, 14}, 64, 64, 200)};
  const BrickGrid<float> solid = solidified(sigma, cameras, plan, {});
  EXPECT_GT(solid.at({14, 14, 14}), 1) << "inside the box";
  EXPECT_GT(solid.at({12, 13, 14}), 1);
  EXPECT_EQ(solid.at({34, 14, 12}), 0) << "below the roof";
  EXPECT_EQ(solid.at({25, 14, 14}), 0) << "outside";
  EXPECT_EQ(solid.at({7, 7, 7}), sigma.at({7, 7, 7})) << "walls stay";
  const SurfaceMesh surface = extract_surface(solid, 1, 1, 0);
  EXPECT_EQ(connected_parts(surface).size(), 2u) << "box and roof; no debris";
}

}  // namespace
}  // namespace cnerf::bake::test
