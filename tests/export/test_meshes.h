#pragma once
/// A small textured mesh with known content.

#include "bake/mesh.h"
#include "src/color/colorspace_math.h"

namespace cnerf::exporting::test {

/// A tetrahedron with a corner at (1, 2, 3) and legs of 1, 2 and 3 world units, each face with a piece of the texture.
inline bake::Mesh tetrahedron(int texture_size = 64) {
  bake::Mesh mesh;
  const Vec3f corners[4] = {{1, 2, 3}, {2, 2, 3}, {1, 4, 3}, {1, 2, 6}};
  const int faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  for (int f = 0; f < 4; ++f) {
    const Vec3f a = corners[faces[f][0]], b = corners[faces[f][1]], c = corners[faces[f][2]];
    const auto first = std::uint32_t(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {a, b, c});
    mesh.normals.insert(mesh.normals.end(), 3, normalized(cross(b - a, c - a)));
    const float u = 0.5f * float(f % 2) + 0.1f, v = 0.5f * float(f / 2) + 0.1f;
    mesh.uvs.insert(mesh.uvs.end(), {{u, v}, {u + 0.3f, v}, {u, v + 0.3f}});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  bake::Texture& texture = mesh.texture;
  texture.size = texture_size;
  for (int y = 0; y < texture_size; ++y) {
    for (int x = 0; x < texture_size; ++x) {
      const float s = float(x) / float(texture_size);
      const Vec3f rgb = y % 2 == 0 ? Vec3f{s, s, s} : Vec3f{0.9f * s, 0.2f, 0.5f};
      const Lab<float> lab = y % 2 == 0 ? Lab<float>{} : lab_from_linear_rgb(rgb);
      texture.rgb.push_back(rgb);
      texture.luminance.push_back(luminance_of(rgb));
      texture.a.push_back(lab.a);
      texture.b.push_back(lab.b);
      texture.coverage.push_back(1);
    }
  }
  mesh.voxel_size = 0.05;
  mesh.charts = 4;
  mesh.gutter = 2;
  mesh.frame = {{1.5, 2.5, 3.5}, 0.125, 2};
  return mesh;
}

}  // namespace cnerf::exporting::test
