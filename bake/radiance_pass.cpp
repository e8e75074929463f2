#include "bake/radiance_pass.h"

#include <array>
#include <cmath>
#include <iterator>

#include "bake/view_selection.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

constexpr std::array<Vec3f, 6> kDefaultDirections{
    {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};

/// What is asked of the field for one brick: for each voxel a run of directions with weights.
struct LuminanceQueries {
  std::vector<std::size_t> voxels;  ///< index into the brick's dense voxels, of those that are kept
  std::vector<std::size_t> ends;    ///< end of each kept voxel's run
  std::vector<Vec3f> centroids;     ///< of each kept voxel, unit space
  std::vector<Vec3f> positions, directions;
  std::vector<float> weights;

  void add(Vec3f position, Vec3f direction, float weight) {
    positions.push_back(position);
    directions.push_back(direction);
    weights.push_back(weight);
  }
};

class BrickRadiance {
 public:
  BrickRadiance(const ColorField& field, const ViewSelection& views, bool has_cameras, const BakePlan& plan,
                const BakeOptions& options, const DensityPass& density)
      : field_(field), views_(views), plan_(plan), density_(density), weight_threshold_(options.weight_threshold) {
    keep_unseen_ = options.keep_unseen || !has_cameras;
  }

  [[nodiscard]] std::vector<BakedVoxel> bake(std::size_t brick) const {
    const std::vector<DenseVoxel>& dense = density_.bricks[brick];
    if (dense.empty()) return {};
    const Vec3i brick_min = density_.sigma.brick_min(brick);
    const LuminanceQueries queries = gather(dense, density_.sigma.brick(brick), brick_min);
    if (queries.voxels.empty()) return {};
    const std::vector<float> luminance = mean_luminance(queries);
    const std::vector<Chromaticity> chromaticity = ask_chromaticity(queries);

    std::vector<BakedVoxel> voxels;
    for (std::size_t v = 0; v < queries.voxels.size(); ++v) {
      const int offset = dense[queries.voxels[v]].offset;
      const Vec3i at = brick_min + brick_local(offset);
      const VoxelColor color = voxel_color(luminance[v], chromaticity[v]);
      voxels.push_back({at.x, at.y, at.z, density_.sigma.brick(brick)[offset], luminance_of(color.rgb), color.rgb,
                        color.a, color.b});
    }
    return voxels;
  }

 private:
  [[nodiscard]] LuminanceQueries gather(const std::vector<DenseVoxel>& dense,
                                        const std::array<float, kBrickVoxels>& sigma, Vec3i brick_min) const {
    constexpr double kHalf = kBrickSide / 2.0;
    const Vec3d centre = plan_.world_from_voxel(brick_min.cast<double>() + Vec3d{kHalf, kHalf, kHalf});
    const std::vector<int> order = views_.try_order(centre);
    LuminanceQueries queries;
    for (std::size_t v = 0; v < dense.size(); ++v) {
      const int offset = dense[v].offset;
      const double opacity = -std::expm1(-sigma[offset] * plan_.voxel_size);
      const auto least = static_cast<float>(weight_threshold_ / opacity);
      if (least > 1 && !keep_unseen_) continue;
      const Vec3i voxel = brick_min + brick_local(offset);
      const Vec3d world = plan_.world_from_voxel(voxel.cast<double>() + dense[v].centroid_in_voxel());
      const std::vector<SeenBy> seen = views_.seen_by(density_.sigma, world, order, keep_unseen_ ? 0 : least);
      if (seen.empty() && !keep_unseen_) continue;
      const Vec3f unit = field_.frame().unit_from_world(world).cast<float>();
      for (const SeenBy& view : seen) queries.add(unit, views_.direction_to(view.camera, world), view.transmittance);
      if (seen.empty()) {
        for (const Vec3f direction : kDefaultDirections) queries.add(unit, direction, 1.0f);
      }
      queries.voxels.push_back(v);
      queries.centroids.push_back(unit);
      queries.ends.push_back(queries.positions.size());
    }
    return queries;
  }

  [[nodiscard]] std::vector<float> mean_luminance(const LuminanceQueries& queries) const {
    std::vector<float> answers(queries.positions.size());
    field_.query_luminance(queries.positions, queries.directions, answers);
    std::vector<float> mean;
    std::size_t begin = 0;
    for (const std::size_t end : queries.ends) {
      double sum = 0, weight = 0;
      for (std::size_t q = begin; q < end; ++q) {
        CNERF_CHECK(std::isfinite(answers[q]), "the field answered a luminance that is not finite");
        sum += static_cast<double>(queries.weights[q]) * answers[q];
        weight += queries.weights[q];
      }
      mean.push_back(static_cast<float>(std::max(0.0, sum / weight)));
      begin = end;
    }
    return mean;
  }

  [[nodiscard]] std::vector<Chromaticity> ask_chromaticity(const LuminanceQueries& queries) const {
    std::vector<Chromaticity> answers(queries.centroids.size());
    field_.query_chromaticity(queries.centroids, answers);
    for (const Chromaticity& c : answers) {
      CNERF_CHECK(std::isfinite(c.x) && std::isfinite(c.z), "the field answered a chromaticity that is not finite");
    }
    return answers;
  }

  const ColorField& field_;
  const ViewSelection& views_;
  const BakePlan& plan_;
  const DensityPass& density_;
  double weight_threshold_ = 0;
  bool keep_unseen_ = false;
};

bool in_gamut(Vec3f rgb, float luminance) {
  const float top = std::max(1.0f, luminance);
  for (int channel = 0; channel < 3; ++channel) {
    if (rgb[channel] < 0 || rgb[channel] > top) return false;
  }
  return true;
}

}  // namespace

VoxelColor voxel_color(float luminance, Chromaticity chromaticity) {
  if (chromaticity.x == 1 && chromaticity.z == 1) return {{luminance, luminance, luminance}, 0, 0};
  const Vec3f xyz{luminance * chromaticity.x, luminance, luminance * chromaticity.z};
  VoxelColor color;
  color.rgb = linear_rgb_from_relative_xyz(xyz);
  if (!in_gamut(color.rgb, luminance)) {
    color.rgb = gamut_mapped_linear_rgb_from_lab(lab_from_linear_rgb(color.rgb));
  }
  const Lab<float> lab = lab_from_linear_rgb(color.rgb);
  color.a = lab.a;
  color.b = lab.b;
  return color;
}

std::vector<BakedVoxel> bake_radiance(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                      const std::vector<BakeLevel>& levels, std::size_t level,
                                      const BakeOptions& options, const std::function<void(double)>& advance) {
  const auto& [plan, density] = levels[level];
  ViewSelection views(cameras, plan, options);
  for (std::size_t other = 0; other < levels.size(); ++other) {
    if (other != level) views.look_through(levels[other].density.sigma, levels[other].plan);
  }
  const BrickRadiance radiance(field, views, !cameras.empty(), plan, options, density);
  std::vector<std::vector<BakedVoxel>> bricks(density.bricks.size());
  parallel_batches(
      bricks.size(), [&](std::size_t brick) { bricks[brick] = radiance.bake(brick); }, advance);
  std::size_t count = 0;
  for (const std::vector<BakedVoxel>& brick : bricks) count += brick.size();
  std::vector<BakedVoxel> voxels;
  voxels.reserve(count);
  for (std::vector<BakedVoxel>& brick : bricks) {
    voxels.insert(voxels.end(), brick.begin(), brick.end());
    std::vector<BakedVoxel>().swap(brick);
  }
  return voxels;
}

}  // namespace cnerf
