#include "src/train/luminance/free_space.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "src/train/luminance/believed_points.h"

namespace cnerf {
namespace {

constexpr int kVotes = 2;               // that make a place free: a way to a point is one, all points of a view are two
constexpr int kSightsAcross = 64;       // cells of a sight along the longer side of its picture
constexpr double kWayRadius = 2.5;      // cells around a point that its view sees through as well
constexpr double kWayShare = 0.9;       // of the way to a point: points are not exact, surfaces between them bend
constexpr double kNearestShare = 0.8;   // of the distance to the nearest of what a view shows
constexpr double kNearQuantile = 0.02;  // of its points, which counts as the nearest: some points are wrong
constexpr std::size_t kFewestPoints = 20;  // of a view that knows what is nearest

bool is_in_picture(const Intrinsics& lens, PixelPosition at) {
  return at.x >= 0 && at.y >= 0 && at.x < lens.width && at.y < lens.height;
}

}  // namespace

double least_cosine_of(const Intrinsics& lens) {
  double least = 1;
  for (const double x : {0.0, double(lens.width)}) {
    for (const double y : {0.0, double(lens.height)}) least = std::min(least, ray_direction(lens, {x, y}).z);
  }
  return least;
}

FreeSpace::Sight::Sight(const View& view, const std::vector<Vec3d>& shown, const std::vector<SkyLabel>& sky)
    : camera_from_world_(view.world_from_camera.inverse()),
      lens_(&view.intrinsics),
      cells_per_pixel_(double(kSightsAcross) / std::max(lens_->width, lens_->height)),
      width_(std::max(1, int(std::ceil(lens_->width * cells_per_pixel_)))),
      height_(std::max(1, int(std::ceil(lens_->height * cells_per_pixel_)))),
      clear_depth_(std::size_t(width_) * std::size_t(height_), 0.0f),
      least_cosine_(least_cosine_of(*lens_)) {
  std::vector<double> depths;
  for (const Vec3d& point : shown) {
    const Vec3d at = camera_from_world_.point(point);
    const auto pixel = project(*lens_, at);
    if (!pixel || !is_in_picture(*lens_, *pixel)) continue;  // a file may state anything
    depths.push_back(at.z);
    clear_way_to(*pixel, at.z);
  }
  clear_way_to_sky(sky);
  if (depths.size() >= kFewestPoints) clear_the_near(std::move(depths));
}

/// Where ways cross in the picture, the nearer point tells.
void FreeSpace::Sight::clear_way_to(PixelPosition pixel, double depth) {
  const double x = pixel.x * cells_per_pixel_, y = pixel.y * cells_per_pixel_;
  const auto clear = float(kWayShare * depth);
  for (int v = std::max(0, int(y - kWayRadius)); v < std::min<double>(height_, y + kWayRadius); ++v) {
    for (int u = std::max(0, int(x - kWayRadius)); u < std::min<double>(width_, x + kWayRadius); ++u) {
      if (std::hypot(u + 0.5 - x, v + 0.5 - y) > kWayRadius) continue;
      float& known = clear_depth_[std::size_t(v) * std::size_t(width_) + std::size_t(u)];
      known = known == 0 ? clear : std::min(known, clear);
    }
  }
}

/// Where all pixels of a cell show it. A point there knows better.
void FreeSpace::Sight::clear_way_to_sky(const std::vector<SkyLabel>& sky) {
  if (sky.empty()) return;
  std::vector<bool> is_sky(clear_depth_.size(), true);
  for (std::size_t p = 0; p < sky.size(); ++p) {
    if (sky[p] == SkyLabel::kSky) continue;
    const std::size_t x = p % std::size_t(lens_->width), y = p / std::size_t(lens_->width);
    const auto u = std::min<std::size_t>(std::size_t(double(x) * cells_per_pixel_), std::size_t(width_) - 1);
    const auto v = std::min<std::size_t>(std::size_t(double(y) * cells_per_pixel_), std::size_t(height_) - 1);
    is_sky[v * std::size_t(width_) + u] = false;
  }
  for (std::size_t c = 0; c < is_sky.size(); ++c) {
    if (is_sky[c] && clear_depth_[c] == 0) clear_depth_[c] = std::numeric_limits<float>::infinity();
  }
}

void FreeSpace::Sight::clear_the_near(std::vector<double> depths) {
  const auto nearest = depths.begin() + std::ptrdiff_t(kNearQuantile * double(depths.size()));
  std::ranges::nth_element(depths, nearest);
  near_ = kNearestShare * *nearest;
  for (float& known : clear_depth_) known = known == 0 ? float(near_) : known;
}

int FreeSpace::Sight::votes_for(Vec3d centre, double radius) const {
  const Vec3d at = camera_from_world_.point(centre);
  const auto pixel = at.z > radius ? project(*lens_, at) : std::nullopt;
  if (!pixel || !is_in_picture(*lens_, *pixel)) return is_near_lens(at, radius) ? kVotes : 0;
  const double x = pixel->x * cells_per_pixel_, y = pixel->y * cells_per_pixel_;
  const double reach = radius / at.z * lens_->fx * cells_per_pixel_;
  for (int v = std::max(0, int(y - reach)); v <= std::min(height_ - 1, int(y + reach)); ++v) {
    for (int u = std::max(0, int(x - reach)); u <= std::min(width_ - 1, int(x + reach)); ++u) {
      if (at.z + radius >= clear_depth_[std::size_t(v) * std::size_t(width_) + std::size_t(u)]) return 0;
    }
  }
  return at.z + radius < near_ ? kVotes : 1;
}

/// Beside the picture less is known: a wall along the way of view that enters the picture at some depth is as far off
/// as half the picture is wide there.
bool FreeSpace::Sight::is_near_lens(Vec3d at, double radius) const {
  const double distance = length(at);
  const bool is_ahead = at.z > least_cosine_ * distance;
  const double half_width = 0.5 * std::min(lens_->width / lens_->fx, lens_->height / lens_->fy);
  const double near = is_ahead ? near_ : near_ * std::min(half_width, 1.0);
  return at.z + radius > 0 && distance + radius < near;
}

FreeSpace::FreeSpace(const std::vector<View>& views, const std::vector<SparsePoint>& points,
                     const std::vector<std::vector<SkyLabel>>& sky) {
  for (const SparsePoint& point : points) {
    if (is_believed(point)) points_.push_back(point.position);
  }
  const std::vector<std::vector<Vec3d>> shown = believed_points(views.size(), points);
  const std::vector<SkyLabel> no_sky;
  std::size_t training = 0;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    if (views[i].held_out) continue;
    const std::vector<SkyLabel>& of_view = sky.empty() ? no_sky : sky[training];
    ++training;
    if (!shown[i].empty() || !of_view.empty()) sights_.emplace_back(views[i], shown[i], of_view);
  }
}

bool FreeSpace::holds(Vec3d centre, double radius) const {
  int votes = 0;
  for (const Sight& sight : sights_) {
    if (votes < kVotes) votes += sight.votes_for(centre, radius);
  }
  const auto is_inside = [&](Vec3d point) { return length(point - centre) < radius; };
  return votes >= kVotes && std::ranges::none_of(points_, is_inside);
}

}  // namespace cnerf
