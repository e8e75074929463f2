/// Texture coordinates: every face once, none over another, and space around the charts.

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "bake/mesh/surface/surface_mesh.h"
#include "bake/mesh/texture/texture_baker.h"
#include "bake/mesh/uv/unwrap.h"
#include "src/base/error.h"
#include "tests/bake/mesh/test_surfaces.h"

namespace cnerf::bake::test {
namespace {

constexpr int kSize = 512, kGutter = 2;

SurfaceMesh test_mesh(int which) {
  if (which == 0) return sphere_surface(32, 11);
  SurfaceMesh mesh = bumpy_surface(40);
  smooth(mesh, 2);
  return which == 1 ? mesh : decimated(mesh, 3000);
}

/// Brute force, independent of the code under test: each point of a lattice four times finer than texels is inside at
/// most one triangle. Points within a thousandth of an edge do not count.
std::size_t doubly_covered(const UnwrappedMesh& mesh) {
  constexpr int kFiner = 4;
  const int side = mesh.size * kFiner;
  std::vector<std::uint8_t> hits(std::size_t(side) * side, 0);
  for (std::size_t f = 0; f < mesh.mesh.triangles.size(); ++f) {
    const PlanarTriangle t = mesh.texture_triangle(f);
    const double area = signed_area(t);
    const auto low = [&](float a, float b, float c) { return std::max(0, int(std::min({a, b, c}) * kFiner) - 1); };
    const auto high = [&](float a, float b, float c) {
      return std::min(side - 1, int(std::max({a, b, c}) * kFiner) + 1);
    };
    for (int y = low(t[0].y, t[1].y, t[2].y); y <= high(t[0].y, t[1].y, t[2].y); ++y) {
      for (int x = low(t[0].x, t[1].x, t[2].x); x <= high(t[0].x, t[1].x, t[2].x); ++x) {
        const Point2 p{(x + 0.5f) / kFiner, (y + 0.5f) / kFiner};
        bool is_inside = true;
        for (int c = 0; c < 3; ++c) is_inside = is_inside && signed_area({t[c], t[(c + 1) % 3], p}) / area > 1e-3;
        if (is_inside) ++hits[std::size_t(y) * side + x];
      }
    }
  }
  return std::size_t(std::count_if(hits.begin(), hits.end(), [](auto n) { return n > 1; }));
}

class Unwrap : public testing::TestWithParam<int> {};

TEST_P(Unwrap, EveryFaceIsInOneChartAndNoTwoOverlap) {
  const SurfaceMesh surface = test_mesh(GetParam());
  const std::vector<UvChart> charts = make_charts(surface);
  std::vector<int> times(surface.triangles.size(), 0);
  for (const UvChart& chart : charts) {
    for (const std::uint32_t face : chart.faces) {
      ++times[face];
      EXPECT_GT(dot(face_normal(surface, surface.triangles[face]), chart.plane.normal()), 0.1f) << "not turned over";
    }
  }
  for (std::size_t f = 0; f < times.size(); ++f) {
    EXPECT_EQ(times[f], length(area_vector(surface, surface.triangles[f])) > 0 ? 1 : 0) << f;
  }
  const UnwrappedMesh mesh = unwrap(surface, kSize, kGutter);
  EXPECT_EQ(doubly_covered(mesh), 0u);
  EXPECT_EQ(mesh.charts, int(charts.size()));
}

TEST_P(Unwrap, ChartsKeepTheirDistance) {
  const UnwrappedMesh mesh = unwrap(test_mesh(GetParam()), kSize, kGutter);
  std::vector<int> owner(std::size_t(kSize) * kSize, -1);
  for (const SurfaceTexel& texel : surface_texels(mesh)) {
    owner[std::size_t(texel.row) * kSize + texel.column] = int(mesh.chart[texel.triangle]);
    EXPECT_TRUE(texel.column >= kGutter && texel.row >= kGutter && texel.column < kSize - kGutter &&
                texel.row < kSize - kGutter);
  }
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const int chart = owner[std::size_t(y) * kSize + x];
      if (chart < 0) continue;
      for (int dy = 0; dy <= 2 * kGutter && y + dy < kSize; ++dy) {
        for (int dx = -2 * kGutter; dx <= 2 * kGutter; ++dx) {
          if (x + dx < 0 || x + dx >= kSize) continue;
          const int other = owner[std::size_t(y + dy) * kSize + x + dx];
          ASSERT_TRUE(other < 0 || other == chart) << x << ", " << y << " and " << dx << ", " << dy;
        }
      }
    }
  }
}

TEST_P(Unwrap, TexelsLieOnTheSurfaceAndVerticesKeepTheirPlaces) {
  const SurfaceMesh surface = test_mesh(GetParam());
  const UnwrappedMesh mesh = unwrap(surface, kSize, kGutter);
  for (std::size_t f = 0; f < mesh.mesh.triangles.size(); ++f) {
    EXPECT_GT(length(area_vector(mesh.mesh, mesh.mesh.triangles[f])), 0);
  }
  std::set<std::tuple<float, float, float>> places;
  for (const Vec3f& p : surface.positions) places.insert({p.x, p.y, p.z});
  for (const Vec3f& p : mesh.mesh.positions) EXPECT_TRUE(places.count({p.x, p.y, p.z}));
  for (const SurfaceTexel& texel : surface_texels(mesh)) {
    const Triangle& t = mesh.mesh.triangles[texel.triangle];
    const Vec3f offset = texel.position - mesh.mesh.positions[t[0]];
    EXPECT_NEAR(dot(offset, face_normal(mesh.mesh, t)), 0, 1e-3) << "in the plane of its triangle";
    EXPECT_NEAR(length(texel.normal), 1, 1e-5);
  }
}

INSTANTIATE_TEST_SUITE_P(Meshes, Unwrap, testing::Values(0, 1, 2));

/// The measure above can fail.
TEST(UnwrapChecks, OverlapsAreNoticed) {
  UnwrappedMesh mesh = unwrap(sphere_surface(24, 8), kSize, kGutter);
  for (Point2& texel : mesh.texels) texel = texel * 0.5f + Point2{100, 100};
  UnwrappedMesh twice = mesh;
  const auto first = std::uint32_t(mesh.texels.size());
  for (const Point2 texel : mesh.texels) twice.texels.push_back(texel + Point2{3, 1});
  for (const Triangle& t : mesh.mesh.triangles)
    twice.mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  EXPECT_EQ(doubly_covered(mesh), 0u);
  EXPECT_GT(doubly_covered(twice), 1000u);
}

TEST(PlanarTriangles, SharedEdgesAreNoOverlapAndSliversAre) {
  const PlanarTriangle a{Point2{0, 0}, {1, 0}, {0, 1}}, neighbour{Point2{1, 0}, {1, 1}, {0, 1}};
  EXPECT_FALSE(overlap(a, neighbour));
  EXPECT_TRUE(overlap(a, a));
  EXPECT_TRUE(overlap(a, {Point2{0.2f, 0.2f}, {0.3f, 0.2f}, {0.2f, 0.3f}})) << "one inside the other";
  EXPECT_TRUE(overlap(a, {Point2{-1, 0.4f}, {2, 0.4f}, {2, 0.45f}})) << "crossing without a corner inside";
  EXPECT_FALSE(overlap(a, {Point2{2, 2}, {3, 2}, {2, 3}}));
  PlanarTriangles set(0.5f);
  set.add(a);
  EXPECT_TRUE(set.fits(neighbour));
  EXPECT_FALSE(set.fits({Point2{0.1f, 0.1f}, {5, 0.2f}, {0.1f, 0.3f}}));
}

TEST(UnwrapChecks, ATextureTooSmallIsRefused) {
  EXPECT_THROW((void)unwrap(bumpy_surface(40), 32, 8), UsageError);
}

}  // namespace
}  // namespace cnerf::bake::test
