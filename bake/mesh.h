#pragma once
/// A baked, textured mesh: plain data, no network, no file format.

#include <array>
#include <cstdint>
#include <vector>

#include "src/base/vec3.h"
#include "src/field/scene_frame.h"

namespace cnerf::bake {

/// Three vertices, counter-clockwise when seen from outside.
using Triangle = std::array<std::uint32_t, 3>;

/// Place in a texture, 0..1; (0, 0) is the upper left corner of the picture.
struct TextureCoordinate {
  float u = 0, v = 0;
};

/// Square texture; [size, size] each, rows from the top.
struct Texture {
  int size = 0;
  std::vector<Vec3f> rgb;        ///< linear Rec.709, in gamut; [0, 1] but for highlights
  std::vector<float> luminance;  ///< linear Y of `rgb`
  std::vector<float> a, b;       ///< CIE Lab (1976, D65) a and b of `rgb`
  std::vector<std::uint8_t>
      coverage;  ///< 1 where a triangle covers the texel's centre; elsewhere colours are filled in
};

struct Mesh {
  std::vector<Vec3f> positions;  ///< world
  std::vector<Vec3f> normals;    ///< unit length, outward
  std::vector<TextureCoordinate> uvs;
  std::vector<Triangle> triangles;  ///< counter-clockwise from outside
  Texture texture;

  double voxel_size = 0;  ///< world units; of the density it was cut from
  int charts = 0;         ///< pieces of the texture
  int gutter = 0;         ///< texels between them, on each side
  SceneFrame frame;       ///< of the field it was baked from
};

}  // namespace cnerf::bake
