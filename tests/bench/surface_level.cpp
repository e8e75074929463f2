// Where should the surface of a bake lie? Along rays of the training views, compares the depth at which half of the
// field's light is taken with the depth at which the baked grid crosses the level of a mesh, for several values of
// mesh.surface_depth. Prints, in voxels, the median offset (positive: the mesh lies behind), the median distance, and
// the shares of rays that meet only one of the two. The median is not what decides: a level that suits most rays loses
// what is thin or loose (mesh_comparison), and a texture makes up for an offset but not for a hole.
//
//   surface_level CAPTURE STAGE1.snapshot [resolution=192] [rays=4000]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <string>

#include "bake/density/density_pass.h"
#include "src/base/rng.h"
#include "src/capture/load_capture.h"
#include "src/train/scene.h"

namespace {

using cnerf::Vec3d;
using cnerf::Vec3i;

struct Line {
  Vec3d origin, direction;  // voxel coordinates, unit length
  double begin, end;
};

constexpr double kStep = 0.25;  // voxels

double interpolated(const cnerf::bake::BrickGrid<float>& sigma, double path, Vec3d p) {
  const Vec3d q = p - Vec3d{0.5, 0.5, 0.5};
  const Vec3i base{int(std::floor(q.x)), int(std::floor(q.y)), int(std::floor(q.z))};
  const Vec3d t = q - base.cast<double>();
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3i s{corner >> 2, corner >> 1 & 1, corner & 1};
    const double weight = (s.x ? t.x : 1 - t.x) * (s.y ? t.y : 1 - t.y) * (s.z ? t.z : 1 - t.z);
    sum += weight * -std::expm1(-double(sigma.at(base + s)) * path);
  }
  return sum;
}

/// First depth at which the share of light taken by `depth` voxels reaches one half.
std::optional<double> level_depth(const cnerf::bake::BrickGrid<float>& sigma, double path, const Line& line) {
  double before = 0;
  for (double t = line.begin; t < line.end; t += kStep) {
    const double value = interpolated(sigma, path, line.origin + line.direction * t);
    if (value >= 0.5) return t - kStep * (value - 0.5) / std::max(value - before, 1e-9);
    before = value;
  }
  return std::nullopt;
}

/// Depth at which the field lets half of the light through.
std::optional<double> field_depth(const cnerf::Scene& scene, const cnerf::bake::Plan& plan, const Line& line) {
  std::vector<cnerf::Vec3f> positions;
  std::vector<double> depths;
  for (double t = line.begin + kStep / 2; t < line.end; t += kStep) {
    const Vec3d world = plan.world_from_voxel(line.origin + line.direction * t);
    const auto unit = scene.frame().unit_from_world(world).cast<float>();
    if (!scene.may_be_occupied(unit)) continue;
    positions.push_back(unit);
    depths.push_back(t);
  }
  std::vector<float> sigma(positions.size());
  scene.query_density(positions, sigma);
  double optical = 0;
  for (std::size_t i = 0; i < sigma.size(); ++i) {
    const double more = sigma[i] * scene.frame().unit_per_world * plan.voxel_size * kStep;
    if (optical + more >= std::log(2.0)) return depths[i] + kStep * ((std::log(2.0) - optical) / more - 0.5);
    optical += more;
  }
  return std::nullopt;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + std::ptrdiff_t(values.size() / 2), values.end());
  return values[values.size() / 2];
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::puts("surface_level CAPTURE STAGE1.snapshot [resolution=N] [rays=N]");
    return 64;
  }
  std::map<std::string, int> options = {{"resolution", 192}, {"rays", 4000}};
  for (int i = 3; i < argc; ++i) {
    const std::string argument = argv[i];
    options.at(argument.substr(0, argument.find('='))) = std::stoi(argument.substr(argument.find('=') + 1));
  }
  const cnerf::Capture capture = cnerf::load_capture(argv[1], {});
  const auto scene = cnerf::Scene::load(argv[2], {}, cnerf::cpu_engines());
  cnerf::bake::Options bake;
  bake.resolution = options["resolution"];
  const cnerf::bake::Plan plan = cnerf::bake::plan_bake(*scene, bake);
  const cnerf::bake::BrickGrid<float> sigma = cnerf::bake::bake_density(*scene, plan, bake, [](double) {});
  const cnerf::Aabbd box{{0, 0, 0}, plan.resolution.cast<double>()};

  std::vector<Line> lines;
  std::vector<std::optional<double>> truth;
  cnerf::SequentialRng random(/*seed=*/1, /*stream=*/0);
  for (int r = 0; r < options["rays"]; ++r) {
    const cnerf::View& view = capture.views[random.below(std::uint32_t(capture.views.size()))];
    const cnerf::Intrinsics& lens = view.intrinsics;
    const cnerf::PixelPosition pixel{random.uniform() * lens.width, random.uniform() * lens.height};
    const Vec3d direction = normalized(view.world_from_camera.direction(cnerf::ray_direction(lens, pixel)));
    const Vec3d origin = (view.world_from_camera.translation - plan.origin) / plan.voxel_size;
    const auto inside = cnerf::intersect(box, origin, direction);
    if (!inside) continue;
    lines.push_back({origin, direction, inside->begin, inside->end});
    truth.push_back(field_depth(*scene, plan, lines.back()));
  }
  for (const double depth : {0.5, 1.0, 2.0, 4.0, 8.0}) {
    std::vector<double> offsets, distances;
    std::size_t only_field = 0, only_mesh = 0;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const auto found = level_depth(sigma, depth * plan.voxel_size, lines[i]);
      only_field += truth[i] && !found ? 1 : 0;
      only_mesh += found && !truth[i] ? 1 : 0;
      if (!found || !truth[i]) continue;
      offsets.push_back(*found - *truth[i]);
      distances.push_back(std::abs(offsets.back()));
    }
    const double percent = 100.0 / double(lines.size());
    std::printf("surface_depth %.1f: offset %+.2f, distance %.2f voxels over %zu rays; ", depth, median(offsets),
                median(distances), offsets.size());
    std::printf("only the field %.2f %%, only the mesh %.2f %%\n", percent * double(only_field),
                percent * double(only_mesh));
  }
  return 0;
}
