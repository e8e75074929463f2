#include "export/web_bricks.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <span>

#include "bake/visibility/clear_grid.h"
#include "bake/volume/dilate.h"
#include "src/base/check.h"
#include "src/color/colorspace_math.h"

namespace cnerf::exporting {
namespace {

constexpr int kSide = kWebBrickSide;
constexpr double kOpaqueDepth = 24;  ///< optical depth of one voxel that no picture tells from more

std::uint8_t byte_of(float value) {
  return std::uint8_t(std::lround(std::clamp(value, 0.0f, 255.0f)));
}

int floor_div(int value, int side) {
  return value >= 0 ? value / side : -((side - 1 - value) / side);
}

/// Fills in counts, origin, cover and distance == 0 of the bricks to store. @return the voxel the grid begins at.
Vec3i lay_out(const bake::Volume& volume, const std::optional<Aabbd>& cover, WebBricks& bricks) {
  std::vector<bake::Voxel> dense;
  for (const bake::Voxel& voxel : volume.voxels) {
    if (voxel.sigma > 0) dense.push_back(voxel);
  }
  CNERF_CHECK(!dense.empty(), "no voxel has density");
  bricks.voxels = dense.size();
  // Interpolation reaches one voxel beyond.
  const bake::VoxelBox box = (cover ? voxels_of(volume, *cover) : bounding_box(dense)).grown(1);
  const Vec3i first = box.low;
  const Vec3i size = box.size();
  for (int axis = 0; axis < 3; ++axis) bricks.counts[axis] = (size[axis] + kSide - 1) / kSide;
  bricks.voxel_size = volume.voxel_size;
  bricks.origin = volume.origin + first.cast<double>() * volume.voxel_size;
  const Vec3i n = bricks.counts;
  const Vec3d end = bricks.origin + (n * kSide).cast<double>() * volume.voxel_size;
  bricks.cover = cover.value_or(Aabbd{bricks.origin, end});
  bricks.distance.assign(std::size_t(n.x) * n.y * n.z, 255);
  for (const bake::Voxel& voxel : dense) {
    const Vec3i v = Vec3i{voxel.i, voxel.j, voxel.k} - first;
    for (int z = floor_div(v.z - 1, kSide); z <= floor_div(v.z + 1, kSide); ++z) {
      for (int y = floor_div(v.y - 1, kSide); y <= floor_div(v.y + 1, kSide); ++y) {
        for (int x = floor_div(v.x - 1, kSide); x <= floor_div(v.x + 1, kSide); ++x) {
          if (x < 0 || y < 0 || z < 0 || x >= n.x || y >= n.y || z >= n.z) continue;
          bricks.distance[(std::size_t(z) * n.y + y) * n.x + x] = 0;
        }
      }
    }
  }
  return first;
}

/// Number of a stored brick among the stored ones, -1 for others.
std::vector<std::int32_t> numbers_of(const WebBricks& bricks, std::size_t& stored) {
  std::vector<std::int32_t> numbers(bricks.distance.size(), -1);
  stored = 0;
  for (std::size_t b = 0; b < numbers.size(); ++b) {
    if (bricks.distance[b] == 0) numbers[b] = std::int32_t(stored++);
  }
  return numbers;
}

/// How many codes a value may change by to be the one that is predicted. Noise below what is seen packs badly.
struct Tolerance {
  std::uint8_t density = 1, lightness = 1, ab = 2;
};
constexpr Tolerance kGap{255, 255, 255};
Tolerance tolerance_of(double optical_depth) {
  if (optical_depth < 0.02) return {1, 4, 6};  // of the voxel: it adds a fiftieth of a pixel's light at most
  if (optical_depth > 6) return {4, 1, 2};     // nothing is seen through it
  return {};
}

/// Replaces values by those before them, as to_differences takes them, wherever that is within tolerance.
void simplify(std::span<std::uint8_t> plane, const std::vector<Tolerance>& tolerances, std::uint8_t Tolerance::*which) {
  for (std::size_t i = 0; i < plane.size(); ++i) {
    const std::size_t local = i % kWebBrickVoxels;
    if (local == 0) continue;
    const std::size_t step = local % kSide ? 1 : local / kSide % kSide ? kSide : kSide * kSide;
    const std::uint8_t before = plane[i - step];
    // What has density keeps some: code 0 is for nothing.
    if (which == &Tolerance::density && (plane[i] == 0) != (before == 0)) continue;
    if (std::abs(plane[i] - before) <= tolerances[i].*which) plane[i] = before;
  }
}

}  // namespace

bake::VoxelBox voxels_of(const bake::Volume& volume, const Aabbd& box) {
  constexpr double kRounding = 1e-4;
  const Vec3d low = (box.min - volume.origin) / volume.voxel_size;
  const Vec3d high = (box.max - volume.origin) / volume.voxel_size;
  bake::VoxelBox voxels;
  for (int axis = 0; axis < 3; ++axis) {
    voxels.low[axis] = int(std::floor(low[axis] + kRounding));
    voxels.high[axis] = int(std::ceil(high[axis] - kRounding));
  }
  return voxels;
}

WebBricks make_web_bricks(const bake::Volume& volume, const std::optional<Aabbd>& cover) {
  WebBricks bricks;
  const Vec3i first = lay_out(volume, cover, bricks);
  const Vec3i n = bricks.counts;
  bake::fill_distances({n.z, n.y, n.x}, bricks.distance);  // x runs fastest
  std::size_t stored = 0;
  const std::vector<std::int32_t> numbers = numbers_of(bricks, stored);

  for (const bake::Voxel& voxel : volume.voxels) bricks.max_density = std::max<double>(bricks.max_density, voxel.sigma);
  bricks.density_scale = std::min(bricks.max_density, kOpaqueDepth / bricks.voxel_size);
  const std::size_t plane = stored * kWebBrickVoxels;
  bricks.density.assign(plane, 0);
  bricks.lab.assign(3 * plane, 128);
  std::vector<Tolerance> tolerances(plane, kGap);

  bake::Volume padded = volume;
  std::erase_if(padded.voxels, [](const bake::Voxel& voxel) { return !(voxel.sigma > 0); });
  dilate_colors(padded, 1);  // colour and density are interpolated apart: neighbours of density need colour too
  for (const bake::Voxel& voxel : padded.voxels) {
    const Vec3i v = Vec3i{voxel.i, voxel.j, voxel.k} - first;
    if (v.x < 0 || v.y < 0 || v.z < 0) continue;
    const Vec3i brick{v.x / kSide, v.y / kSide, v.z / kSide};
    if (brick.x >= n.x || brick.y >= n.y || brick.z >= n.z) continue;
    const std::int32_t number = numbers[(std::size_t(brick.z) * n.y + brick.y) * n.x + brick.x];
    if (number < 0) continue;
    const int local = ((v.z % kSide) * kSide + v.y % kSide) * kSide + v.x % kSide;
    const std::size_t at = std::size_t(number) * kWebBrickVoxels + std::size_t(local);
    bricks.density[at] = byte_of(255 * std::cbrt(voxel.sigma / float(bricks.density_scale)));
    const float lightness = lightness_from_luminance(luminance_of(voxel.rgb));
    bricks.lab[at] = byte_of(lightness * 2.55f);
    bricks.lab[plane + at] = byte_of(voxel.a + 128);
    bricks.lab[2 * plane + at] = byte_of(voxel.b + 128);
    tolerances[at] = tolerance_of(voxel.sigma * bricks.voxel_size);
  }
  const std::span<std::uint8_t> lab(bricks.lab);
  simplify(lab.subspan(0, plane), tolerances, &Tolerance::lightness);
  simplify(lab.subspan(plane, plane), tolerances, &Tolerance::ab);
  simplify(lab.subspan(2 * plane, plane), tolerances, &Tolerance::ab);
  simplify(bricks.density, tolerances, &Tolerance::density);
  return bricks;
}

void to_differences(std::vector<std::uint8_t>& bricks) {
  CNERF_CHECK(bricks.size() % kWebBrickVoxels == 0, "whole bricks only");
  for (std::size_t begin = 0; begin < bricks.size(); begin += kWebBrickVoxels) {
    for (int i = kWebBrickVoxels - 1; i > 0; --i) {
      const int step = i % kSide ? 1 : i / kSide % kSide ? kSide : kSide * kSide;
      std::uint8_t& value = bricks[begin + std::size_t(i)];
      value = std::uint8_t(value - bricks[begin + std::size_t(i - step)]);
    }
  }
}

}  // namespace cnerf::exporting
