#include "bake/mesh/texture/texel_shader.h"

#include <algorithm>
#include <cmath>

#include "bake/color/point_color.h"
#include "src/base/check.h"

namespace cnerf::bake {
namespace {

constexpr double kRayOutside = 2;  ///< voxels outside the surface where a texel's ray starts
constexpr double kRayInside = 4;   ///< voxels inside where it ends
constexpr double kSamplesPerVoxel = 4;
constexpr float kLeastTransmittance = 0.01f;  ///< a ray ends below this
constexpr float kLeastWeight = 1e-3f;         ///< of a sample, to be looked up
constexpr float kLeastCosine = 0.05f;         ///< a view that looks along the surface still counts a little
constexpr int kViewsOfTexel = 6;              ///< that it is averaged over, at most

Options with_views(Options bake) {
  bake.views_per_voxel = kViewsOfTexel;
  return bake;
}

/// How far, in voxels, one choice of cameras to try holds: they are far away compared to it.
constexpr float kSameCameras = 6;

}  // namespace

/// A point inside a ray that carries some of its opacity.
struct TexelShader::Sample {
  std::uint32_t point;
  float weight;
  Vec3f unit;  ///< unit space
};

struct TexelShader::View {
  Vec3f direction;  ///< unit length, from the camera
  float weight;
};

TexelShader::TexelShader(const ColorField& field, const std::vector<Camera>& cameras, const Plan& plan,
                         const Options& bake, const BrickGrid<float>& sigma)
    : field_(field), plan_(plan), views_(cameras, {{&sigma, plan.origin, plan.voxel_size}}, with_views(bake)) {}

std::vector<TexelShader::Sample> TexelShader::samples_along_rays(std::span<const SurfacePoint> points,
                                                                 std::vector<SurfaceColor>& colors) const {
  const double length = kRayOutside + kRayInside;
  const int steps = std::max(1, int(std::ceil(length * kSamplesPerVoxel)));
  const double step = length / steps;  // voxels
  std::vector<Vec3f> positions;        // unit space
  std::vector<Sample> samples;
  for (std::uint32_t p = 0; p < points.size(); ++p) {
    for (int s = 0; s < steps; ++s) {
      const double depth = (s + 0.5) * step - kRayOutside;
      const Vec3d voxel = points[p].position.cast<double>() - points[p].normal.cast<double>() * depth;
      const Vec3d world = plan_.world_from_voxel(voxel);
      const Vec3f unit = field_.frame().unit_from_world(world).cast<float>();
      if (!Aabbf{{0, 0, 0}, {1, 1, 1}}.contains(unit) || !field_.may_be_occupied(unit)) continue;
      samples.push_back({p, 0, unit});
      positions.push_back(unit);
    }
  }
  std::vector<float> sigma(positions.size());
  field_.query_density(positions, sigma);

  const auto path = float(step * plan_.voxel_size * field_.frame().unit_per_world);
  std::vector<Sample> carrying;
  float transmittance = 1;
  for (std::size_t s = 0; s < samples.size(); ++s) {
    if (s == 0 || samples[s].point != samples[s - 1].point) transmittance = 1;
    if (transmittance < kLeastTransmittance) continue;
    CNERF_CHECK(std::isfinite(sigma[s]) && sigma[s] >= 0, "the field answered a density that is not a finite >= 0");
    const float weight = transmittance * -std::expm1(-sigma[s] * path);
    transmittance -= weight;
    if (weight < kLeastWeight) continue;
    colors[samples[s].point].opacity += weight;
    carrying.push_back({samples[s].point, weight, samples[s].unit});
  }
  return carrying;
}

std::vector<std::vector<TexelShader::View>> TexelShader::views_of(std::span<const SurfacePoint> points) const {
  std::vector<std::vector<View>> views(points.size());
  std::vector<std::int32_t> order;
  Vec3f order_is_for{};
  for (std::size_t p = 0; p < points.size(); ++p) {
    const SurfacePoint& point = points[p];
    // From just outside, so that the surface does not hide itself.
    const Vec3d world = plan_.world_from_voxel((point.position + point.normal).cast<double>());
    if (p == 0 || length(point.position - order_is_for) > kSameCameras) {
      order = try_order(views_.eyes(), world);
      order_is_for = point.position;
    }
    for (const SeenBy& seen : views_.seen_by(0, world, order)) {
      const Vec3f direction = direction_to(views_.eyes()[seen.camera], world);
      const float cosine = -dot(direction, point.normal);
      if (cosine <= 0) continue;  // sees it from behind, through an edge
      views[p].push_back({direction, seen.transmittance * std::max(cosine, kLeastCosine)});
    }
    if (views[p].empty()) views[p].push_back({-point.normal, 1});
  }
  return views;
}

std::vector<SurfaceColor> TexelShader::shade(std::span<const SurfacePoint> points) const {
  std::vector<SurfaceColor> colors(points.size());
  const std::vector<Sample> samples = samples_along_rays(points, colors);
  const std::vector<std::vector<View>> views = views_of(points);

  ViewMeans means;  // of every sample
  std::vector<Vec3f> positions;
  for (const Sample& sample : samples) {
    positions.push_back(sample.unit);
    for (const View& view : views[sample.point]) means.look_along(sample.unit, view.direction, view.weight);
    means.next_point();
  }
  const std::vector<float> luminance = means.luminance(field_);
  const std::vector<Chromaticity> chromaticity = chromaticity_of(field_, positions);

  std::vector<Vec3d> light(points.size());  // XYZ relative to white, times opacity
  for (std::size_t s = 0; s < samples.size(); ++s) {
    const double y = double(luminance[s]) * samples[s].weight;
    const Chromaticity& c = chromaticity[s];
    light[samples[s].point] += Vec3d{y * c.x, y, y * c.z};
  }
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (colors[p].opacity <= 0) continue;
    colors[p].luminance = float(light[p].y / colors[p].opacity);
    if (light[p].y > 0) {
      colors[p].chromaticity = {float(light[p].x / light[p].y), float(light[p].z / light[p].y)};
    }
  }
  return colors;
}

}  // namespace cnerf::bake
