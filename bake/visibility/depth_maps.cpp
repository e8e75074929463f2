#include "bake/visibility/depth_maps.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

constexpr double kCellsAcross = 256;    // of the longer side of a picture, at most
constexpr double kMostCells = 1 << 24;  // of all pictures: 64 MiB, and a third of that for squares
constexpr int kLevels = 7;              // squares of 1 to 64 cells
constexpr double kStretch = 2;          // of a lens that distorts, beside a straight picture, at most
constexpr float kNever = std::numeric_limits<float>::infinity();

/// Squares of 2^level cells along a side of `cells`.
constexpr int squares(int cells, int level) {
  return (cells + (1 << level) - 1) >> level;
}
constexpr std::size_t square_count(int width, int height, int level) {
  return std::size_t(squares(width, level)) * squares(height, level);
}

/// To each of n values, `stride` apart, the largest of it and its two neighbours.
void widen_line(float* values, int n, std::size_t stride) {
  float before = values[0];
  for (int i = 0; i < n; ++i) {
    const float here = values[i * stride], after = i + 1 < n ? values[(i + 1) * stride] : here;
    values[i * stride] = std::max({before, here, after});
    before = here;
  }
}

/// The same with all that touch it.  @param values  [height][width]
void widen(float* values, int width, int height) {
  for (int y = 0; y < height; ++y) widen_line(values + std::size_t(y) * width, width, 1);
  for (int x = 0; x < width; ++x) widen_line(values + x, height, std::size_t(width));
}

/// World units; infinite where light comes from as far as the levels reach.
float sight_end(const Eye& eye, const Affined& world_from_camera, PixelPosition pixel,
                std::span<const SightLevel<ClearGrid>> levels) {
  const Vec3d direction = world_from_camera.linear * lens::ray_direction(eye.intrinsics, pixel);
  float end = kNever;
  for (std::size_t l = levels.size(); l-- > 0;) {  // the finest first: it lies before the others
    const SightLevel<ClearGrid>& level = levels[l];
    end = std::min(end, sight_end(*level.sigma, level.voxel_size, level.voxel_from_world(eye.centre),
                                  direction.cast<float>(), end));
  }
  return end;
}

}  // namespace

DepthMaps::DepthMaps(std::span<const Eye> eyes, std::span<const SightLevel<ClearGrid>> levels) {
  double pixels = 0, across = 1;
  for (const Eye& eye : eyes) {
    pixels += double(eye.intrinsics.width) * eye.intrinsics.height;
    across = std::max(across, double(std::max(eye.intrinsics.width, eye.intrinsics.height)));
  }
  pixels_per_cell_ = std::max({1.0, across / kCellsAcross, std::sqrt(pixels / kMostCells)});
  std::size_t end = 0;
  for (const Eye& eye : eyes) {
    const auto cells = [&](int length) { return int(std::ceil(length / pixels_per_cell_)); };
    const Place& place = places_.emplace_back(Place{end, cells(eye.intrinsics.width), cells(eye.intrinsics.height)});
    for (int level = 0; level < kLevels; ++level) end += square_count(place.width, place.height, level);
  }
  values_.resize(end);
  parallel_tasks(eyes.size(), [&](std::size_t e) { make(e, eyes[e], levels); });
}

void DepthMaps::make(std::size_t number, const Eye& eye, std::span<const SightLevel<ClearGrid>> levels) {
  const auto& [first, width, height] = places_[number];
  const Affined world_from_camera = eye.camera_from_world.inverse();
  float* finer = values_.data() + first;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const PixelPosition middle{(x + 0.5) * pixels_per_cell_, (y + 0.5) * pixels_per_cell_};
      finer[std::size_t(y) * width + x] = sight_end(eye, world_from_camera, middle, levels);
    }
  }
  for (int level = 1; level <= kLevels; ++level) {
    const int across = squares(width, level - 1), down = squares(height, level - 1);
    float* coarser = finer + std::size_t(across) * down;
    if (level < kLevels) {
      for (int y = 0; y < down; ++y) {
        for (int x = 0; x < across; ++x) {
          float& square = coarser[std::size_t(y / 2) * squares(width, level) + x / 2];
          square = std::max(square, finer[std::size_t(y) * across + x]);
        }
      }
    }
    widen(finer, across, down);
    finer = coarser;
  }
}

bool DepthMaps::may_see(std::size_t number, const Eye& eye, Vec3d centre, double radius) const {
  const Vec3d in_camera = eye.camera_from_world.point(centre);
  const double front = in_camera.z - radius;
  if (in_camera.z + radius <= 0) return false;
  const auto pixel = lens::project(eye.intrinsics, in_camera);
  if (front < radius || !pixel) return true;
  // How far from that the ball's points may be, in pixels.
  const double slant = length(in_camera) / in_camera.z;
  const double stretch = eye.intrinsics.model == LensModel::kPinhole ? 1 : kStretch;
  const double around = stretch * std::max(eye.intrinsics.fx, eye.intrinsics.fy) * slant * radius / front;
  const double right = eye.intrinsics.width + around, bottom = eye.intrinsics.height + around;
  if (pixel->x < -around || pixel->y < -around || pixel->x > right || pixel->y > bottom) return false;

  const auto& [first, width, height] = places_[number];
  const float* squares_of_level = values_.data() + first;
  int level = 0;
  for (; around > pixels_per_cell_ * (1 << level); ++level) {  // a square and those around it hold the ball
    if (level + 1 == kLevels) return true;
    squares_of_level += square_count(width, height, level);
  }
  const auto square = [&](double position, int cells) {
    return std::clamp(int(position / pixels_per_cell_) >> level, 0, squares(cells, level) - 1);
  };
  const std::size_t at = std::size_t(square(pixel->y, height)) * squares(width, level) + square(pixel->x, width);
  return length(centre - eye.centre) - radius <= double(squares_of_level[at]);
}

DepthMap DepthMaps::map(std::size_t eye, const float* values) const {
  const auto& [first, width, height] = places_[eye];
  return {values + first, width, height, float(1 / pixels_per_cell_)};
}

}  // namespace cnerf::bake
