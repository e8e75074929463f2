#include "bake/splat/place.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/base/rng.h"

namespace cnerf::bake {
namespace {

constexpr double kCandidatesPerSplat = 6;
constexpr double kFlatness = 0.15;  ///< thickness of a disc, of its radius
constexpr double kRadius = 0.6;     ///< standard deviation of a disc, of its spacing
constexpr double kMostSlope = 8;    ///< pixels' sides between the depths of neighbours on one surface
constexpr float kOpacity = 0.9f;
constexpr int kCoarserOctaves = 4;  ///< that a splat keeps its cell of for itself

/// The step from a pixel to its neighbour on the same surface along one axis, world units; the one that is less deep
/// or high than the other.
std::optional<Vec3d> step_on_surface(const SplatTarget& target, int x, int y, int dx, int dy) {
  const auto width = target.intrinsics.width, height = target.intrinsics.height;
  const double depth = target.depth[std::size_t(y) * std::size_t(width) + std::size_t(x)];
  std::optional<Vec3d> step;
  double least = kMostSlope * target.footprint(depth);
  for (const int side : {-1, 1}) {
    const int nx = x + side * dx, ny = y + side * dy;
    if (nx < 0 || ny < 0 || nx >= width || ny >= height) continue;
    const double other = target.depth[std::size_t(ny) * std::size_t(width) + std::size_t(nx)];
    if (other <= 0 || std::abs(other - depth) > least) continue;
    least = std::abs(other - depth);
    step = (target.point(nx, ny, other) - target.point(x, y, depth)) * double(side);
  }
  return step;
}

/// The quaternion w x y z of a rotation.
std::array<float, 4> quaternion_of(const Mat3d& r) {
  const Vec3d x = r.rows[0], y = r.rows[1], z = r.rows[2];
  // Shepperd 1978: by the largest of the four, which no rounding makes small.
  const std::array<double, 4> squares = {1 + x.x + y.y + z.z, 1 + x.x - y.y - z.z, 1 - x.x + y.y - z.z,
                                         1 - x.x - y.y + z.z};
  const auto largest = std::ranges::max_element(squares) - squares.begin();
  const double twice = std::sqrt(squares[std::size_t(largest)]);
  const double a = 0.5 / twice;
  std::array<double, 4> q{};
  if (largest == 0) q = {0.5 * twice, (z.y - y.z) * a, (x.z - z.x) * a, (y.x - x.y) * a};
  if (largest == 1) q = {(z.y - y.z) * a, 0.5 * twice, (x.y + y.x) * a, (x.z + z.x) * a};
  if (largest == 2) q = {(x.z - z.x) * a, (x.y + y.x) * a, 0.5 * twice, (y.z + z.y) * a};
  if (largest == 3) q = {(y.x - x.y) * a, (x.z + z.x) * a, (y.z + z.y) * a, 0.5 * twice};
  return {float(q[0]), float(q[1]), float(q[2]), float(q[3])};
}

/// A pixel that might become a splat.
struct Candidate {
  Vec3f point;      ///< world
  float footprint;  ///< side of the pixel there
  std::uint32_t target, pixel;
};

std::vector<Candidate> find_candidates(std::span<const SplatTarget> targets, std::size_t count) {
  double shown = 0;
  for (const SplatTarget& target : targets) {
    shown += double(std::ranges::count_if(target.depth, [](float depth) { return depth > 0; }));
  }
  const auto share = float(std::min(1.0, kCandidatesPerSplat * double(count) / std::max(1.0, shown)));
  std::vector<std::vector<Candidate>> of_target(targets.size());
  parallel_tasks(targets.size(), [&](std::size_t t) {
    const SplatTarget& target = targets[t];
    const CounterRng rng(t, named_stream("splats"));
    for (std::size_t p = 0; p < target.pixels(); ++p) {
      const float depth = target.depth[p];
      if (depth <= 0 || rng.uniform(p) >= share) continue;
      const auto width = std::size_t(target.intrinsics.width);
      of_target[t].push_back({target.point(int(p % width), int(p / width), depth).cast<float>(),
                              float(target.footprint(depth)), std::uint32_t(t), std::uint32_t(p)});
    }
  });
  std::vector<Candidate> all;
  for (const auto& some : of_target) all.insert(all.end(), some.begin(), some.end());
  std::ranges::stable_sort(all, {}, &Candidate::footprint);
  return all;
}

/// A set of cells of lattices whose cells are powers of two large.
class CellSet {
 public:
  explicit CellSet(std::size_t most) : keys_(std::bit_ceil(2 * most + 16), 0) {}
  /// @return  whether it was not there before
  bool insert(Vec3f point, int octave) {
    std::uint64_t key = std::uint64_t(octave + 1024);
    for (int axis = 0; axis < 3; ++axis) {
      key = mix_bits(key ^ std::uint64_t(std::int64_t(std::floor(std::ldexp(double(point[axis]), -octave)))));
    }
    key |= 1;  // 0 marks free places
    for (std::size_t at = key >> 8 & (keys_.size() - 1);; at = (at + 1) & (keys_.size() - 1)) {
      if (keys_[at] == key) return false;
      if (keys_[at] != 0) continue;
      keys_[at] = key;
      return true;
    }
  }

 private:
  std::vector<std::uint64_t> keys_;
};

int octave_of(const Candidate& candidate, double pixels) {
  return int(std::floor(std::log2(double(candidate.footprint) * pixels)));
}

/// Those that remain where each keeps about `pixels` of its pixels' sides around it to itself, or the first `most` + 1
/// of them. Fine ones come first.
std::vector<std::uint32_t> thinned(std::span<const Candidate> candidates, double pixels, std::size_t most) {
  CellSet cells((most + 1) * (kCoarserOctaves + 1));
  std::vector<std::uint32_t> kept;
  for (std::size_t i = 0; i < candidates.size() && kept.size() <= most; ++i) {
    const int octave = octave_of(candidates[i], pixels);
    if (!cells.insert(candidates[i].point, octave)) continue;
    kept.push_back(std::uint32_t(i));
    for (int coarser = 1; coarser <= kCoarserOctaves; ++coarser) cells.insert(candidates[i].point, octave + coarser);
  }
  return kept;
}

}  // namespace

std::optional<PlacedSplat> splat_at_pixel(const SplatTarget& target, int x, int y, double spacing) {
  const std::size_t at = std::size_t(y) * std::size_t(target.intrinsics.width) + std::size_t(x);
  if (target.depth[at] <= 0) return std::nullopt;
  const auto along_x = step_on_surface(target, x, y, 1, 0);
  const auto along_y = step_on_surface(target, x, y, 0, 1);
  if (!along_x || !along_y) return std::nullopt;
  const Vec3d normal = normalized(cross(*along_x, *along_y));
  const Vec3d tangent = normalized(*along_x - normal * dot(normal, *along_x));
  PlacedSplat placed;
  placed.spacing = float(spacing);
  Splat& splat = placed.splat;
  splat.position = target.point(x, y, target.depth[at]).cast<float>();
  const auto radius = float(std::log(kRadius * spacing));
  splat.log_scale = {radius, radius, radius + float(std::log(kFlatness))};
  splat.rotation = quaternion_of(Mat3d::from_columns(tangent, cross(normal, tangent), normal));
  splat.opacity_logit = logit(kOpacity);
  const float opacity = float(std::max<int>(1, target.rgba[4 * at + 3])) / 255;
  for (int c = 0; c < 3; ++c) {
    splat.color[c] = std::min(1.0f, float(target.rgba[4 * at + std::size_t(c)]) / 255 / opacity);
  }
  return placed;
}

std::vector<PlacedSplat> place_splats(std::span<const SplatTarget> targets, std::size_t count) {
  const std::vector<Candidate> candidates = find_candidates(targets, count);
  double low = 3, high = 64;  // pixels' sides between splats; those that lie closer show nothing new
  std::vector<std::uint32_t> kept = thinned(candidates, high, count);
  for (int round = 0; round < 9; ++round) {
    const double middle = std::sqrt(low * high);
    std::vector<std::uint32_t> some = thinned(candidates, middle, count);
    if (some.size() > count) {
      low = middle;
    } else {
      high = middle;
      kept = std::move(some);
    }
  }
  if (kept.size() > count) kept.resize(count);
  std::vector<std::optional<PlacedSplat>> placed(kept.size());
  parallel_ranges(kept.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Candidate& candidate = candidates[kept[i]];
      const SplatTarget& target = targets[candidate.target];
      const auto width = std::uint32_t(target.intrinsics.width);
      placed[i] = splat_at_pixel(target, int(candidate.pixel % width), int(candidate.pixel / width),
                                 std::ldexp(1.0, octave_of(candidate, high)));
    }
  });
  std::vector<PlacedSplat> splats;
  for (const auto& one : placed) {
    if (one) splats.push_back(*one);
  }
  if (splats.empty()) throw InputError("splats: the field's pictures show no surface to place them on");
  return splats;
}

}  // namespace cnerf::bake
