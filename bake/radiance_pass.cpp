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
      : field_(field), views_(views), plan_(plan), density_(density) {
    keep_unseen_ = options.keep_unseen || !has_cameras;
  }

  [[nodiscard]] std::vector<BakedVoxel> bake(std::size_t brick) const {
    const std::vector<DenseVoxel>& dense = density_.bricks[brick];
    if (dense.empty()) return {};
    const Vec3i brick_min = density_.sigma.brick_min(brick);
    const LuminanceQueries queries = gather(dense, brick_min);
    if (queries.voxels.empty()) return {};
    const std::vector<float> luminance = mean_luminance(queries);
    const std::vector<Chromaticity> chromaticity = ask_chromaticity(dense, queries);

    std::vector<BakedVoxel> voxels;
    for (std::size_t v = 0; v < queries.voxels.size(); ++v) {
      const DenseVoxel& voxel = dense[queries.voxels[v]];
      const Vec3i at = brick_min + brick_local(voxel.offset);
      const VoxelColor color = voxel_color(luminance[v], chromaticity[v]);
      voxels.push_back({at.x, at.y, at.z, voxel.sigma, luminance_of(color.rgb), color.rgb, color.a, color.b});
    }
    return voxels;
  }

 private:
  [[nodiscard]] LuminanceQueries gather(const std::vector<DenseVoxel>& dense, Vec3i brick_min) const {
    constexpr double kHalf = kBrickSide / 2.0;
    const Vec3d centre = plan_.world_from_voxel(brick_min.cast<double>() + Vec3d{kHalf, kHalf, kHalf});
    const std::vector<int> order = views_.try_order(centre);
    LuminanceQueries queries;
    for (std::size_t v = 0; v < dense.size(); ++v) {
      const Vec3d world = field_.frame().world_from_unit(dense[v].centroid.cast<double>());
      const std::vector<SeenBy> seen = views_.seen_by(density_.sigma, world, order);
      if (seen.empty() && !keep_unseen_) continue;
      for (const SeenBy& view : seen) {
        queries.add(dense[v].centroid, views_.direction_to(view.camera, world), view.transmittance);
      }
      if (seen.empty()) {
        for (const Vec3f direction : kDefaultDirections) queries.add(dense[v].centroid, direction, 1.0f);
      }
      queries.voxels.push_back(v);
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

  [[nodiscard]] std::vector<Chromaticity> ask_chromaticity(const std::vector<DenseVoxel>& dense,
                                                           const LuminanceQueries& queries) const {
    std::vector<Vec3f> positions;
    for (const std::size_t v : queries.voxels) positions.push_back(dense[v].centroid);
    std::vector<Chromaticity> answers(positions.size());
    field_.query_chromaticity(positions, answers);
    for (const Chromaticity& c : answers) {
      CNERF_CHECK(std::isfinite(c.x) && std::isfinite(c.z), "the field answered a chromaticity that is not finite");
    }
    return answers;
  }

  const ColorField& field_;
  const ViewSelection& views_;
  const BakePlan& plan_;
  const DensityPass& density_;
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
                                      const BakePlan& plan, const BakeOptions& options, const DensityPass& density,
                                      const std::function<void(double)>& advance) {
  const ViewSelection views(cameras, plan, options);
  const BrickRadiance radiance(field, views, !cameras.empty(), plan, options, density);
  std::vector<std::vector<BakedVoxel>> bricks(density.bricks.size());
  parallel_batches(
      bricks.size(), [&](std::size_t brick) { bricks[brick] = radiance.bake(brick); }, advance);
  std::vector<BakedVoxel> voxels;
  for (std::vector<BakedVoxel>& brick : bricks) {
    voxels.insert(voxels.end(), brick.begin(), brick.end());
    std::vector<BakedVoxel>().swap(brick);
  }
  return voxels;
}

}  // namespace cnerf
