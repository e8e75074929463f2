#include "bake/mesh/texture/texture_baker.h"

#include <algorithm>

#include "bake/color/voxel_color.h"
#include "bake/mesh/texture/texel_map.h"
#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"

namespace cnerf::bake {
namespace {

constexpr int kTile = 32;               ///< texels along a side: what a task shades in one go
constexpr float kLeastOpacity = 0.02f;  ///< a ray that met less has no colour to speak of

/// Texels of each square tile of the texture; tiles are tasks.
std::vector<std::vector<SurfaceTexel>> tiles_of(const UnwrappedMesh& mesh) {
  const int across = (mesh.size + kTile - 1) / kTile;
  std::vector<std::vector<SurfaceTexel>> tiles(std::size_t(across) * across);
  for (const SurfaceTexel& texel : surface_texels(mesh)) {
    tiles[std::size_t(texel.row / kTile) * across + texel.column / kTile].push_back(texel);
  }
  // Neighbours in the tile may be of different charts: those of one triangle are close in space.
  for (auto& tile : tiles) {
    std::stable_sort(tile.begin(), tile.end(),
                     [](const SurfaceTexel& a, const SurfaceTexel& b) { return a.triangle < b.triangle; });
  }
  return tiles;
}

struct TexelColor {
  Vec3f rgb{};
  float a = 0, b = 0;
};

void put(Texture& texture, std::size_t at, const TexelColor& color) {
  texture.rgb[at] = color.rgb;
  texture.luminance[at] = luminance_of(color.rgb);
  texture.a[at] = color.a;
  texture.b[at] = color.b;
}

void shade_tile(const std::vector<SurfaceTexel>& texels, const TexelShader& shader, Texture& texture) {
  std::vector<SurfacePoint> points;
  for (const SurfaceTexel& texel : texels) points.push_back({texel.position, texel.normal});
  const std::vector<SurfaceColor> colors = shader.shade(points);
  for (std::size_t t = 0; t < texels.size(); ++t) {
    if (colors[t].opacity < kLeastOpacity) continue;
    const VoxelColor color = voxel_color(colors[t].luminance, colors[t].chromaticity);
    const std::size_t at = std::size_t(texels[t].row) * texture.size + texels[t].column;
    put(texture, at, {color.rgb, color.a, color.b});
    texture.coverage[at] = 1;
  }
}

/// A colour from a linear mean: Lab follows from it, so that all maps of a texel say the same.
TexelColor color_of_mean(Vec3f rgb) {
  const bool is_grey = rgb.x == rgb.y && rgb.y == rgb.z;
  const Lab<float> lab = is_grey ? Lab<float>{} : lab_from_linear_rgb(rgb);
  return {rgb, lab.a, lab.b};
}

}  // namespace

void fill_in(Texture& texture, int reach) {
  const int size = texture.size;
  std::vector<std::uint8_t> known = texture.coverage;
  std::vector<std::size_t> front;  // texels that the last step reached
  Vec3d sum{};
  for (std::size_t at = 0; at < known.size(); ++at) {
    if (!known[at]) continue;
    front.push_back(at);
    sum += texture.rgb[at].cast<double>();
  }
  const Vec3f mean = front.empty() ? Vec3f{} : (sum / double(front.size())).cast<float>();

  const auto neighbours = [&](std::size_t at, const auto& visit) {
    const int x = int(at % size), y = int(at / size);
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int nx = x + dx, ny = y + dy;
        if (nx >= 0 && ny >= 0 && nx < size && ny < size) visit(std::size_t(ny) * size + nx);
      }
    }
  };
  for (int step = 0; step < reach; ++step) {
    std::vector<std::size_t> reached;
    for (const std::size_t from : front) {
      neighbours(from, [&](std::size_t at) {
        if (known[at]) return;
        known[at] = 2;  // reached in this step: not yet a source
        reached.push_back(at);
      });
    }
    std::sort(reached.begin(), reached.end());
    for (const std::size_t at : reached) {
      Vec3f colors{};
      float count = 0;
      neighbours(at, [&](std::size_t from) {
        if (known[from] != 1) return;
        colors += texture.rgb[from];
        ++count;
      });
      put(texture, at, color_of_mean(colors / count));
    }
    for (const std::size_t at : reached) known[at] = 1;
    front = std::move(reached);
  }
  for (std::size_t at = 0; at < known.size(); ++at) {
    if (!known[at]) put(texture, at, color_of_mean(mean));
  }
}

Texture bake_texture(const UnwrappedMesh& mesh, const TexelShader& shader, int reach,
                     const std::function<void(double)>& advance) {
  Texture texture;
  texture.size = mesh.size;
  const std::size_t texels = std::size_t(mesh.size) * mesh.size;
  texture.rgb.resize(texels);
  for (auto* map : {&texture.luminance, &texture.a, &texture.b}) map->resize(texels);
  texture.coverage.resize(texels);
  const auto tiles = tiles_of(mesh);
  constexpr std::size_t kBatches = 64;
  for (std::size_t batch = 0; batch < kBatches; ++batch) {
    const std::size_t begin = tiles.size() * batch / kBatches, end = tiles.size() * (batch + 1) / kBatches;
    parallel_tasks(end - begin, [&](std::size_t i) {
      if (!tiles[begin + i].empty()) shade_tile(tiles[begin + i], shader, texture);
    });
    advance(double(batch + 1) / kBatches);
  }
  fill_in(texture, reach);
  return texture;
}

}  // namespace cnerf::bake
