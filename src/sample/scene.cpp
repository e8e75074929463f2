#include "src/sample/scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "src/base/rng.h"

namespace cnerf::sample {
namespace {

constexpr double kSurfaceOffset = 1e-4;  ///< starts secondary rays off the surface they leave

// The sun is a disc, large enough for soft shadows; the sky is brighter at the zenith than at the horizon.
const Vec3d kSunDirection = normalized(Vec3d{0.55, -0.5, 0.85});
constexpr double kSunDistance = 5.0;
constexpr double kSunRadius = 0.55;
constexpr Vec3d kSunColor = {0.80, 0.77, 0.71};
constexpr Vec3d kSkyColor = {0.40, 0.44, 0.50};
constexpr double kHorizon = 0.6;     ///< brightness of the sky at the horizon, relative to the zenith
constexpr double kSecondary = 0.14;  ///< what other surfaces send back, relative to the sky
constexpr double kShininess = 40;

Mat3d rotation_z(double degrees) {
  const double r = degrees * std::numbers::pi / 180;
  return {{{std::cos(r), -std::sin(r), 0}, {std::sin(r), std::cos(r), 0}, {0, 0, 1}}};
}
Mat3d rotation_x(double degrees) {
  const double r = degrees * std::numbers::pi / 180;
  return {{{1, 0, 0}, {0, std::cos(r), -std::sin(r)}, {0, std::sin(r), std::cos(r)}}};
}

std::vector<Object> make_objects() {
  using enum ShapeKind;
  const Mat3d lying = rotation_z(35) * rotation_x(90);
  return {
      {{kCylinder, {0.93, 0.03, 0}, {0, 0, -0.03}, rotation_z(12)}, planks, 0},
      {{kSphere, {0.25, 0, 0}, {-0.32, -0.43, 0.25}, rotation_x(28)}, striped_ball, 0.10},
      {{kBox, {0.19, 0.19, 0.19}, {-0.50, 0.22, 0.19}, rotation_z(27)}, blue_checker, 0},
      {{kSphere, {0.12, 0, 0}, {-0.50, 0.22, 0.50}, rotation_x(-20)}, pink_swirl, 0.05},
      {{kCylinder, {0.15, 0.09, 0}, {0.05, 0.50, 0.09}}, terracotta, 0},
      {{kCylinder, {0.045, 0.06, 0}, {0.05, 0.50, 0.22}}, planks, 0},
      {{kCone, {0.29, 0.32, 0}, {0.05, 0.50, 0.26}}, foliage, 0},
      {{kCone, {0.23, 0.28, 0}, {0.05, 0.50, 0.46}, rotation_z(40)}, foliage, 0},
      {{kCone, {0.16, 0.27, 0}, {0.05, 0.50, 0.64}, rotation_z(80)}, foliage, 0},
      {{kCylinder, {0.17, 0.21, 0}, {0.53, 0.10, 0.21}, rotation_z(15)}, yellow_spots, 0.06},
      {{kTorus, {0.19, 0.075, 0}, {0.16, -0.42, 0.075}}, purple_wedges, 0.08},
      {{kCapsule, {0.085, 0.14, 0}, {0.60, -0.40, 0.085}, lying}, orange_peel, 0.05},
      {{kBox, {0.10, 0.10, 0.14}, {0.02, 0.04, 0.14}, rotation_z(-18)}, teal_bricks, 0},
      {{kSphere, {0.075, 0, 0}, {-0.02, -0.76, 0.07}}, pebble, 0},
      {{kSphere, {0.055, 0, 0}, {-0.76, -0.16, 0.05}, rotation_x(70)}, pebble, 0},
      {{kSphere, {0.065, 0, 0}, {0.42, 0.62, 0.06}, rotation_x(30)}, pebble, 0},
  };
}

/// True when something stands between a surface and the light. Such rays go up, so the plate, the first object, which
/// lies below all others, cannot be it.
bool is_blocked(const Ray& ray, double t_max) {
  const std::vector<Object>& all = objects();
  return std::any_of(all.begin() + 1, all.end(), [&](const Object& object) {
    return object.shape.may_meet(ray, 0.0, t_max) && intersect(object.shape, ray, 0.0, t_max).has_value();
  });
}

/// Two axes across a direction.
struct Frame {
  Vec3d tangent, bitangent;
};
Frame frame_around(Vec3d axis) {
  const Vec3d helper = std::abs(axis.z) < 0.9 ? Vec3d{0, 0, 1} : Vec3d{1, 0, 0};
  const Vec3d tangent = normalized(cross(helper, axis));
  return {tangent, cross(axis, tangent)};
}

/// Samples of the unit square: one in each cell of a grid, all shifted together by a random amount.
class Stratified {
 public:
  Stratified(int side, std::uint64_t random, std::uint64_t stream) : side_(side), rng_(random, stream) {
    shift_x_ = rng_.uniform(0);
    shift_y_ = rng_.uniform(1);
  }
  [[nodiscard]] int count() const { return side_ * side_; }
  struct Point {
    double u, v;
  };
  [[nodiscard]] Point operator[](int index) const {
    const std::uint64_t bits = rng_.bits(std::uint64_t(2 + index));  // one draw serves both coordinates
    const double u = (index % side_ + double(bits >> 32) * 0x1p-32) / side_ + shift_x_;
    const double v = (index / side_ + double(bits & 0xFFFFFFFFu) * 0x1p-32) / side_ + shift_y_;
    return {u - std::floor(u), v - std::floor(v)};
  }

 private:
  int side_;
  CounterRng rng_;
  double shift_x_, shift_y_;
};

/// A uniform sample of the unit disc, from a table: two samples in each shading would spend their time in sin and cos.
struct DiscPoint {
  double x, y;
};
constexpr int kDiscCells = 64;
std::vector<DiscPoint> make_disc_table() {
  std::vector<DiscPoint> table;
  for (int i = 0; i < kDiscCells; ++i) {
    for (int j = 0; j < kDiscCells; ++j) {
      const double radius = std::sqrt((i + 0.5) / kDiscCells);
      const double angle = 2 * std::numbers::pi * (j + 0.5) / kDiscCells;
      table.push_back({radius * std::cos(angle), radius * std::sin(angle)});
    }
  }
  return table;
}
DiscPoint disc_point(Stratified::Point p) {
  static const std::vector<DiscPoint> table = make_disc_table();
  return table[std::size_t(p.u * kDiscCells) * kDiscCells + std::size_t(p.v * kDiscCells)];
}

/// What the sun sends: its share that is visible times the cosine, and a highlight beside it.
struct SunLight {
  double diffuse = 0, highlight = 0;
};
SunLight sun_light(const ScenePoint& point, Vec3d to_eye, const Stratified& samples) {
  static const Frame across = frame_around(kSunDirection);
  const Vec3d start = point.position + point.normal * kSurfaceOffset;
  SunLight light;
  for (int i = 0; i < samples.count(); ++i) {
    const DiscPoint p = disc_point(samples[i]);
    const Vec3d target = kSunDirection * kSunDistance + (across.tangent * p.x + across.bitangent * p.y) * kSunRadius;
    const Vec3d to_sun = normalized(target - start);
    const double cosine = dot(point.normal, to_sun);
    if (cosine <= 0 || is_blocked({start, to_sun}, kSunDistance)) continue;
    light.diffuse += cosine;
    if (point.object->gloss > 0) {
      light.highlight += std::pow(std::max(0.0, dot(point.normal, normalized(to_sun + to_eye))), kShininess);
    }
  }
  return {light.diffuse / samples.count(), light.highlight / samples.count()};
}

/// Mean brightness of the sky over the hemisphere of the normal, weighted by the cosine.
double sky_light(const ScenePoint& point, const Stratified& samples) {
  const Frame across = frame_around(point.normal);
  const Vec3d start = point.position + point.normal * kSurfaceOffset;
  double sum = 0;
  for (int i = 0; i < samples.count(); ++i) {
    const DiscPoint p = disc_point(samples[i]);  // lifted to the hemisphere, it is distributed by the cosine
    const double up = std::sqrt(std::max(0.0, 1 - p.x * p.x - p.y * p.y));
    const Vec3d direction = across.tangent * p.x + across.bitangent * p.y + point.normal * up;
    const bool sky = direction.z > 0 && !is_blocked({start, direction}, 3.0);
    sum += sky ? kHorizon + (1 - kHorizon) * direction.z : kSecondary;
  }
  return sum / samples.count();
}

Vec3d times(Vec3d a, Vec3d b) {
  return {a.x * b.x, a.y * b.y, a.z * b.z};
}

Ray camera_ray(const Intrinsics& intrinsics, const Affined& world_from_camera, PixelPosition pixel) {
  return {world_from_camera.translation, world_from_camera.direction(ray_direction(intrinsics, pixel))};
}

}  // namespace

const std::vector<Object>& objects() {
  static const std::vector<Object> all = make_objects();
  return all;
}

Aabbd bounds() {
  return {{-1.0, -1.0, -0.12}, {1.0, 1.0, 1.0}};
}

std::optional<ScenePoint> trace(const Ray& ray) {
  ScenePoint point;
  double nearest = 1e9;
  for (const Object& object : objects()) {
    if (!object.shape.may_meet(ray, 0.0, nearest)) continue;
    if (const auto hit = intersect(object.shape, ray, 0.0, nearest)) {
      nearest = hit->t;
      point = {&object, hit->t, {}, hit->normal};
    }
  }
  if (point.object == nullptr) return std::nullopt;
  point.position = ray.origin + ray.direction * point.t;
  return point;
}

Vec3d shade(const ScenePoint& point, const Ray& ray, int light_samples, std::uint64_t random) {
  const SunLight sun = sun_light(point, -ray.direction, Stratified(light_samples, random, 1));
  const double sky = sky_light(point, Stratified(light_samples, random, 2));
  const Vec3d reflectance = point.object->texture(point.object->shape.local(point.position));
  const Vec3d light = kSunColor * sun.diffuse + kSkyColor * sky;
  return times(reflectance, light) + kSunColor * (point.object->gloss * sun.highlight);
}

PixelColor render_pixel(const Intrinsics& intrinsics, const Affined& world_from_camera, int x, int y, int side,
                        std::uint64_t random) {
  constexpr int kLightSamples = 2;  // squared, for each sample of the pixel
  const CounterRng rng(random, 0);
  PixelColor color;
  for (int i = 0; i < side * side; ++i) {
    const auto draw = std::uint64_t(2 * i);
    const PixelPosition position = {x + (i % side + double(rng.uniform(draw))) / side,
                                    y + (i / side + double(rng.uniform(draw + 1))) / side};
    const Ray ray = camera_ray(intrinsics, world_from_camera, position);
    const std::optional<ScenePoint> point = trace(ray);
    if (!point) continue;
    color.rgb += shade(*point, ray, kLightSamples, rng.bits(std::uint64_t(1 << 20) + draw));
    color.alpha += 1;
  }
  const double samples = side * side;
  return {color.rgb / samples, color.alpha / samples};
}

float depth_of_pixel(const Intrinsics& intrinsics, const Affined& world_from_camera, int x, int y) {
  const Vec3d direction = ray_direction(intrinsics, {x + 0.5, y + 0.5});
  const auto point = trace({world_from_camera.translation, world_from_camera.direction(direction)});
  return point ? float(point->t * direction.z) : 0.0f;
}

}  // namespace cnerf::sample
