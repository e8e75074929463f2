#include "src/prepare/upright.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <regex>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/rng.h"
#include "src/base/statistics.h"
#include "src/base/text.h"

namespace cnerf::prepare {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

// How far the horizontal axes must spread before they tell up: the middle eigenvalue of their mean outer product, which
// is sin^2 of the spread.
constexpr double kAxesSpread = 0.02;
constexpr double kLevelWithin = 60 * kDegree;   ///< of up by axes and up by tops, or the axes mislead (upright formats)
constexpr double kGroundWithin = 30 * kDegree;  ///< of a ground's normal and up by cameras
constexpr double kGroundThickness = 0.02;       ///< of the points' median distance from their middle
constexpr double kLeastSpread = 1e-10;          ///< of rays that meet, see nearest_point
constexpr double kGroundShare = 0.12, kBelowGround = 0.05;

Vec3d median_of(const std::vector<Vec3d>& points) {
  Vec3d out;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vec3d& point : points) values.push_back(point[axis]);
    out[axis] = median(std::move(values));
  }
  return out;
}

void add_outer(Mat3d& sum, Vec3d v) {
  for (int row = 0; row < 3; ++row) sum.rows[row] += v * v[row];
}

/// Whether a view shows a point, and how deep.
std::optional<double> depth_in_view(const View& view, Vec3d point) {
  const Vec3d in_camera = view.world_from_camera.inverse().point(point);
  if (in_camera.z <= 0) return std::nullopt;
  const auto pixel = project(view.intrinsics, in_camera);
  if (!pixel || pixel->x < 0 || pixel->y < 0 || pixel->x >= view.intrinsics.width ||
      pixel->y >= view.intrinsics.height) {
    return std::nullopt;
  }
  return in_camera.z;
}

/// The direction that is given as up; nothing where it is to be found.  @throws UsageError  another text
std::optional<Vec3d> given_up(const std::string& text) {
  if (text == "auto" || text == "cameras" || text == "none") return std::nullopt;
  Vec3d v;
  char rest = 0;
  const int read = std::sscanf(text.c_str(), "%lf,%lf,%lf%c", &v.x, &v.y, &v.z, &rest);
  if (read != 3 || !(length(v) > 1e-12) || !std::isfinite(length(v))) {
    throw UsageError("up: expected auto, cameras, none or x,y,z, found '" + text + "'");
  }
  return normalized(v);
}

// ---- measures -----------------------------------------------------------------------------------------------------

/// A pixel of a view that is not looked up yet.
struct NamedPixel {
  double x = 0, y = 0;
  std::string view;
};

/// A known length, and what shows each of its ends.
struct Measure {
  std::vector<NamedPixel> a, b;
  double metres = 0;
};

double measured_number(const std::string& text) {
  if (const auto value = value_in<double>(text)) return *value;
  throw UsageError("measure: expected a number, found '" + text + "'");
}

/// "x,y,view+x,y,view".
std::vector<NamedPixel> parse_end(const std::string& text) {
  static const std::regex sighting(R"(\s*([0-9.]+),([0-9.]+),([^+]+))");
  std::vector<NamedPixel> out;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find('+', begin), text.size());
    const std::string part = text.substr(begin, end - begin);
    std::smatch match;
    if (!std::regex_match(part, match, sighting)) {
      throw UsageError("measure: expected x,y,view, found '" + part + "'");
    }
    out.push_back({measured_number(match[1]), measured_number(match[2]), match[3].str()});
    begin = end + 1;
  }
  return out;
}

Measure parse_measure(const std::string& text) {
  static const std::regex whole(R"(\s*(\S+)\s+(\S+)\s*=\s*([0-9.]+)\s*(mm|cm|m|km|in|ft)?\s*)");
  std::smatch match;
  if (!std::regex_match(text, match, whole)) {
    throw UsageError("measure: expected 'x1,y1,view1 x2,y2,view2 = 1.2m', found '" + text + "'");
  }
  const std::string unit = match[4];
  const double in_metres = unit == "mm"   ? 1e-3
                           : unit == "cm" ? 1e-2
                           : unit == "km" ? 1e3
                           : unit == "in" ? 0.0254
                           : unit == "ft" ? 0.3048
                                          : 1.0;
  Measure out = {parse_end(match[1]), parse_end(match[2]), measured_number(match[3]) * in_metres};
  if (!(out.metres > 0)) throw UsageError("measure: expected a length above 0, found '" + match[3].str() + "'");
  return out;
}

struct SeenAt {
  double x = 0, y = 0;
  const View* view = nullptr;
};

const View& view_named(const std::string& name, const std::vector<View>& views) {
  for (const View& view : views) {
    const std::filesystem::path file = std::filesystem::path(view.name).filename();
    if (name == view.name || name == file || name == file.stem()) return view;
  }
  throw UsageError("measure: expected the name of a registered view, found '" + name + "'");
}

std::vector<SeenAt> looked_up(const std::vector<NamedPixel>& pixels, const std::vector<View>& views) {
  std::vector<SeenAt> out;
  for (const NamedPixel& pixel : pixels) {
    const View& view = view_named(pixel.view, views);
    if (pixel.x > view.intrinsics.width || pixel.y > view.intrinsics.height) {
      throw UsageError(fmt::format("measure: expected a pixel of {} ({} x {}), found {},{}", view.name,
                                   view.intrinsics.width, view.intrinsics.height, pixel.x, pixel.y));
    }
    out.push_back({pixel.x, pixel.y, &view});
  }
  return out;
}

WorldRay ray_of(const SeenAt& seen) {
  const Affined& pose = seen.view->world_from_camera;
  return {pose.translation, normalized(pose.linear * ray_direction(seen.view->intrinsics, {seen.x, seen.y}))};
}

/// The place of an end that one view shows: as deep as what lies nearest around it in the picture.
Vec3d place_by_points(const SeenAt& seen, const std::vector<Vec3d>& points) {
  const View& view = *seen.view;
  const double reach = 0.03 * std::max(view.intrinsics.width, view.intrinsics.height);
  std::vector<double> depths;
  for (const Vec3d& point : points) {
    const Vec3d in_camera = view.world_from_camera.inverse().point(point);
    const auto pixel = in_camera.z > 0 ? project(view.intrinsics, in_camera) : std::nullopt;
    if (pixel && std::hypot(pixel->x - seen.x, pixel->y - seen.y) < reach) depths.push_back(in_camera.z);
  }
  if (depths.size() < 3) {
    throw InputError(
        fmt::format("measure: {},{} of {}: expected at least 3 sparse points within {:.0f} pixels, found {};"
                    " name the same place in a second view: x,y,view+x,y,view",
                    seen.x, seen.y, view.name, reach, depths.size()));
  }
  const Vec3d direction = ray_direction(view.intrinsics, {seen.x, seen.y});
  return view.world_from_camera.point(direction * (quantile(std::move(depths), 0.3) / direction.z));
}

Vec3d place_of(const std::vector<SeenAt>& sightings, const std::vector<Vec3d>& points) {
  if (sightings.size() == 1) return place_by_points(sightings.front(), points);
  std::vector<WorldRay> rays;
  for (const SeenAt& seen : sightings) rays.push_back(ray_of(seen));
  return triangulate(rays).point;
}

}  // namespace

UpFromCameras up_from_cameras(const std::vector<Affined>& world_from_camera) {
  Mat3d axes{};
  Vec3d tops{};
  const double share = 1.0 / double(world_from_camera.size());
  for (const Affined& pose : world_from_camera) {
    add_outer(axes, pose.linear.column(0) * std::sqrt(share));
    tops += -pose.linear.column(1) * share;
  }
  const SymmetricEigen eigen = symmetric_eigen(axes);
  Vec3d up = eigen.vectors.column(0);
  if (dot(up, tops) < 0) up = -up;
  if (length(tops) < 1e-9) return {up, true};
  const bool spread = eigen.values.y > kAxesSpread && eigen.values.x < 0.25 * eigen.values.y;
  if (spread && dot(up, normalized(tops)) > std::cos(kLevelWithin)) return {up, true};
  return {normalized(tops), false};
}

std::optional<GroundPlane> find_ground(const std::vector<Vec3d>& points, Vec3d roughly_up) {
  if (points.size() < 50) return std::nullopt;
  const Vec3d middle = median_of(points);
  std::vector<double> distances;
  for (const Vec3d& point : points) distances.push_back(length(point - middle));
  const double thickness = kGroundThickness * median(distances);
  const CounterRng rng(named_stream("ground"), 0);
  GroundPlane best;
  for (std::uint64_t trial = 0; trial < 2000; ++trial) {
    const auto pick = [&](std::uint64_t k) { return points[rng.below(trial * 3 + k, std::uint32_t(points.size()))]; };
    const Vec3d a = pick(0), span = cross(pick(1) - a, pick(2) - a);
    if (!(length(span) > 1e-12)) continue;
    Vec3d normal = normalized(span);
    if (dot(normal, roughly_up) < 0) normal = -normal;
    if (dot(normal, roughly_up) < std::cos(kGroundWithin)) continue;
    std::size_t on = 0, below = 0;
    for (const Vec3d& point : points) {
      const double height = dot(normal, point - a);
      on += std::abs(height) < thickness ? 1 : 0;
      below += height < -3 * thickness ? 1 : 0;
    }
    const double share = double(on) / double(points.size());
    if (share > best.share && double(below) < kBelowGround * double(points.size()))
      best = {normal, dot(normal, a), share};
  }
  if (best.share < kGroundShare) return std::nullopt;
  // Refine: the plane of least squared distance to its points.
  Vec3d mean{};
  std::vector<Vec3d> on;
  for (const Vec3d& point : points) {
    if (std::abs(dot(best.normal, point) - best.height) < thickness) on.push_back(point);
  }
  for (const Vec3d& point : on) mean += point / double(on.size());
  Mat3d spread{};
  for (const Vec3d& point : on) add_outer(spread, point - mean);
  Vec3d normal = symmetric_eigen(spread).vectors.column(0);
  if (dot(normal, roughly_up) < 0) normal = -normal;
  return GroundPlane{normal, dot(normal, mean), best.share};
}

Triangulated triangulate(const std::vector<WorldRay>& rays) {
  CNERF_CHECK(rays.size() >= 2, "a place is triangulated from two rays at least");
  double least_cosine = 1;
  for (const WorldRay& a : rays) {
    for (const WorldRay& b : rays) least_cosine = std::min(least_cosine, dot(a.direction, b.direction));
  }
  Triangulated out;
  out.widest_degrees = std::acos(std::clamp(least_cosine, -1.0, 1.0)) / kDegree;
  const std::optional<Vec3d> nearest = nearest_point(rays, kLeastSpread);
  if (!nearest) throw InputError("triangulation: the rays are parallel, so they meet nowhere");
  out.point = *nearest;
  double squared = 0;
  for (const WorldRay& ray : rays) {
    const Vec3d off = cross(out.point - ray.origin, ray.direction);
    squared += dot(off, off);
  }
  out.distance = std::sqrt(squared / double(rays.size()));
  return out;
}

double units_per_metre(const std::string& measure, const std::vector<View>& views, const std::vector<Vec3d>& points) {
  const Measure known = parse_measure(measure);
  const Vec3d a = place_of(looked_up(known.a, views), points), b = place_of(looked_up(known.b, views), points);
  const double units = length(a - b);
  if (!(units > 1e-9 * mean_distance(views, a))) throw UsageError("measure: both ends are the same place");
  return units / known.metres;
}

void check_texts(const FrameOptions& options) {
  (void)given_up(options.up);
  if (!options.measure.empty()) (void)parse_measure(options.measure);
  if (!options.box.empty()) (void)parse_box(options.box);
}

FrameChoice choose_frame(const std::vector<View>& views, const std::vector<Vec3d>& points,
                         const FrameOptions& options) {
  const Vec3d subject = arrangement_of(views, points).focus;
  const double distance = mean_distance(views, subject);
  std::vector<Vec3d> near_points;
  for (const Vec3d& point : points) {
    if (length(point - subject) < distance) near_points.push_back(point);
  }

  FrameChoice out;
  if (options.up == "none") {
    out.up_by = "none";
    out.capture_from_poses.scale = options.scale > 0 ? options.scale : 1;
  } else {
    std::vector<Affined> poses;
    for (const View& view : views) poses.push_back(view.world_from_camera);
    const UpFromCameras cameras = up_from_cameras(poses);
    Vec3d up = cameras.up;
    out.up_by = cameras.from_axes ? "level cameras" : "camera tops";
    std::optional<GroundPlane> ground;
    if (options.up == "auto") {
      ground = find_ground(near_points, up);
    } else if (const auto given = given_up(options.up)) {
      up = *given;
      out.up_by = "given";
    }
    if (ground) {
      up = ground->normal;
      out.up_by = "ground";
      out.ground_share = ground->share;
    }
    Similarity& frame = out.capture_from_poses;
    frame.rotation = rotation_between(up, {0, 0, 1});
    frame.scale = options.scale > 0 ? options.scale : 1 / distance;
    const Vec3d base = subject + up * ((ground ? ground->height : dot(up, subject)) - dot(up, subject));
    frame.translation = -(frame.scale * (frame.rotation * base));
  }
  if (!options.measure.empty()) {
    const double scale = 1 / units_per_metre(options.measure, views, points);
    out.capture_from_poses.translation = out.capture_from_poses.translation * (scale / out.capture_from_poses.scale);
    out.capture_from_poses.scale = scale;
    out.metres = true;
  }
  return out;
}

Aabbd parse_box(const std::string& text) {
  Vec3d a, b;
  char rest = 0;
  const int read = std::sscanf(text.c_str(), "%lf,%lf,%lf %lf,%lf,%lf %c", &a.x, &a.y, &a.z, &b.x, &b.y, &b.z, &rest);
  Aabbd box = Aabbd::empty();
  box.grow(a);
  box.grow(b);
  const Vec3d size = box.size();
  if (read != 6 || !(size.x > 0 && size.y > 0 && size.z > 0) || !std::isfinite(length(a) + length(b))) {
    throw UsageError("box: expected two corners 'x,y,z x,y,z' that differ along every axis, found '" + text + "'");
  }
  return box;
}

std::optional<SubjectBox> find_subject(const std::vector<View>& views, const std::vector<Vec3d>& points) {
  SubjectBox out;
  const CameraArrangement cameras = arrangement_of(views, points);
  out.forward_facing = cameras.forward_facing;
  const double reach =
      out.forward_facing ? std::numeric_limits<double>::infinity() : mean_distance(views, cameras.focus);
  std::vector<Vec3d> inside;
  std::vector<double> depths;
  for (const Vec3d& point : points) {
    std::size_t seen = 0;
    for (const View& view : views) {
      const auto depth = depth_in_view(view, point);
      if (depth) depths.push_back(*depth);
      seen += depth ? 1 : 0;
    }
    const std::size_t enough = std::max<std::size_t>(2, views.size() * 3 / 10);
    if (seen >= enough && length(point - cameras.focus) < reach) inside.push_back(point);
  }
  if (inside.size() < 20) return std::nullopt;
  out.near = 0.9 * quantile(depths, 0.001);
  out.far = 1.1 * quantile(depths, 0.999);
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vec3d& point : inside) values.push_back(point[axis]);
    const double low = quantile(values, 0.01), high = quantile(values, 0.99);
    const double pad = 0.05 * (high - low) + 1e-9;
    out.box.min[axis] = low - pad;
    out.box.max[axis] = high + pad;
  }
  return out;
}

}  // namespace cnerf::prepare
