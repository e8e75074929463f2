#include "bake/mesh/uv/uv_charts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <queue>

namespace cnerf::bake {
namespace {

PlanarTriangle shrunk(const PlanarTriangle& t) {
  constexpr float kShrink = 1e-3f;
  const Point2 middle = (t[0] + t[1] + t[2]) * (1.0f / 3);
  PlanarTriangle result;
  for (int corner = 0; corner < 3; ++corner) result[corner] = t[corner] + (middle - t[corner]) * kShrink;
  return result;
}

/// Whether an edge of `a` has all of `b` on its far side (separating axis theorem).
bool an_edge_separates(const PlanarTriangle& a, const PlanarTriangle& b) {
  for (int corner = 0; corner < 3; ++corner) {
    const Point2 edge = a[(corner + 1) % 3] - a[corner];
    Point2 outward{edge.y, -edge.x};
    if (dot(outward, a[(corner + 2) % 3] - a[corner]) > 0) outward = outward * -1.0f;
    const auto is_beyond = [&](Point2 p) { return dot(outward, p - a[corner]) >= 0; };
    if (is_beyond(b[0]) && is_beyond(b[1]) && is_beyond(b[2])) return true;
  }
  return false;
}

constexpr float kGrowDegrees = 60;  ///< a chart grows over faces whose normal is within this of its own
constexpr float kMergeDegrees =
    80;  ///< one that fits into a neighbour within this is merged: fewer seams, more stretch
constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

float cosine_of_degrees(float degrees) {
  return std::cos(degrees * std::numbers::pi_v<float> / 180);
}

/// Neighbours over edges that exactly two faces share; others are borders of charts.
std::vector<std::array<std::uint32_t, 3>> face_neighbours(const SurfaceMesh& mesh) {
  struct Side {
    std::uint64_t edge;
    std::uint32_t face, corner;
  };
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (std::uint32_t f = 0; f < mesh.triangles.size(); ++f) {
    for (std::uint32_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t a = mesh.triangles[f][corner], b = mesh.triangles[f][(corner + 1) % 3];
      sides.push_back({std::uint64_t(std::min(a, b)) << 32 | std::max(a, b), f, corner});
    }
  }
  std::sort(sides.begin(), sides.end(),
            [](const Side& a, const Side& b) { return a.edge != b.edge ? a.edge < b.edge : a.face < b.face; });
  std::vector<std::array<std::uint32_t, 3>> neighbours(mesh.triangles.size(), {kNone, kNone, kNone});
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    while (end < sides.size() && sides[end].edge == sides[begin].edge) ++end;
    if (end - begin != 2) continue;
    neighbours[sides[begin].face][sides[begin].corner] = sides[begin + 1].face;
    neighbours[sides[begin + 1].face][sides[begin + 1].corner] = sides[begin].face;
  }
  return neighbours;
}

ChartPlane plane_across(Vec3f normal) {
  const int least = std::abs(normal.x) <= std::abs(normal.y) && std::abs(normal.x) <= std::abs(normal.z) ? 0
                    : std::abs(normal.y) <= std::abs(normal.z)                                           ? 1
                                                                                                         : 2;
  Vec3f axis{};
  axis[least] = 1;
  const Vec3f u = normalized(cross(axis, normal));
  return {u, cross(normal, u)};
}

/// A chart while it grows.
struct Patch {
  std::vector<std::uint32_t> faces;
  ChartPlane plane;
  PlanarTriangles laid;
};

class ChartMaker {
 public:
  explicit ChartMaker(const SurfaceMesh& mesh)
      : mesh_(mesh), neighbours_(face_neighbours(mesh)), patch_of_(mesh.triangles.size(), kNone) {
    double area = 0;
    for (const Triangle& t : mesh.triangles) {
      const Vec3f vector = area_vector(mesh, t);
      areas_.push_back(length(vector) / 2);
      normals_.push_back(areas_.back() > 0 ? vector / (2 * areas_.back()) : Vec3f{});
      area += areas_.back();
    }
    cell_ = float(std::sqrt(2 * area / std::max<double>(1, double(areas_.size()))));
  }

  [[nodiscard]] std::vector<UvChart> make() {
    for (const std::uint32_t seed : faces_by_area()) {
      if (patch_of_[seed] == kNone && areas_[seed] > 0) lay_out(grown_from(seed));
    }
    merge_patches();
    std::vector<UvChart> charts;
    for (Patch& patch : patches_) {
      if (!patch.faces.empty()) charts.push_back({std::move(patch.faces), patch.plane});
    }
    return charts;
  }

 private:
  [[nodiscard]] std::vector<std::uint32_t> faces_by_area() const {
    std::vector<std::uint32_t> faces(areas_.size());
    std::iota(faces.begin(), faces.end(), 0u);
    std::stable_sort(faces.begin(), faces.end(), [&](auto a, auto b) { return areas_[a] > areas_[b]; });
    return faces;
  }

  /// Faces around a seed, those nearest to the patch's mean normal first.
  [[nodiscard]] std::vector<std::uint32_t> grown_from(std::uint32_t seed) const {
    const float least_cosine = cosine_of_degrees(kGrowDegrees);
    using Candidate = std::pair<float, std::uint32_t>;  // cosine when it was found
    std::priority_queue<Candidate> front;
    std::vector<std::uint32_t> faces;
    std::map<std::uint32_t, bool> seen{{seed, true}};
    Vec3f sum{};
    front.push({1.0f, seed});
    while (!front.empty()) {
      const std::uint32_t face = front.top().second;
      front.pop();
      if (!faces.empty() && dot(normals_[face], sum) < least_cosine * length(sum)) continue;
      faces.push_back(face);
      sum += normals_[face] * areas_[face];
      for (const std::uint32_t next : neighbours_[face]) {
        if (next == kNone || patch_of_[next] != kNone || areas_[next] <= 0 || seen[next]) continue;
        seen[next] = true;
        front.push({dot(normals_[next], sum) / length(sum), next});
      }
    }
    return faces;
  }

  [[nodiscard]] PlanarTriangle projected(std::uint32_t face, const ChartPlane& plane) const {
    const Triangle& t = mesh_.triangles[face];
    return {plane.project(mesh_.positions[t[0]]), plane.project(mesh_.positions[t[1]]),
            plane.project(mesh_.positions[t[2]])};
  }

  [[nodiscard]] bool faces_plane(std::uint32_t face, const ChartPlane& plane) const {
    return dot(normals_[face], plane.normal()) >= cosine_of_degrees(kMergeDegrees);
  }

  /// Lays faces into one plane; those that would overlap stay free for later patches.
  void lay_out(const std::vector<std::uint32_t>& faces) {
    Patch patch{{}, plane_across(mean_normal(faces)), PlanarTriangles(cell_)};
    const auto index = std::uint32_t(patches_.size());
    // The seed always fits an empty plane of its own.
    if (!faces_plane(faces.front(), patch.plane)) patch.plane = plane_across(normals_[faces.front()]);
    for (const std::uint32_t face : faces) {
      if (!faces_plane(face, patch.plane)) continue;
      const PlanarTriangle laid = projected(face, patch.plane);
      if (!patch.laid.fits(laid)) continue;
      patch.laid.add(laid);
      patch.faces.push_back(face);
      patch_of_[face] = index;
    }
    patches_.push_back(std::move(patch));
  }

  /// Small patches first, each into the neighbour with which it shares most edges and into which it fits; again as
  /// long as that leaves fewer.
  void merge_patches() {
    constexpr int kRounds = 8;
    for (int round = 0; round < kRounds && merge_once(); ++round) {
    }
  }

  bool merge_once() {
    bool merged = false;
    std::vector<std::uint32_t> order(patches_.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [&](auto a, auto b) { return patches_[a].faces.size() < patches_[b].faces.size(); });
    for (const std::uint32_t patch : order) {
      for (const std::uint32_t target : neighbours_by_shared_edges(patch)) {
        if (!merge_into(patch, target)) continue;
        merged = true;
        break;
      }
    }
    return merged;
  }

  [[nodiscard]] std::vector<std::uint32_t> neighbours_by_shared_edges(std::uint32_t patch) const {
    std::map<std::uint32_t, int> shared;
    for (const std::uint32_t face : patches_[patch].faces) {
      for (const std::uint32_t next : neighbours_[face]) {
        if (next != kNone && patch_of_[next] != kNone && patch_of_[next] != patch) ++shared[patch_of_[next]];
      }
    }
    std::vector<std::uint32_t> targets;
    for (const auto& [target, count] : shared) targets.push_back(target);
    std::stable_sort(targets.begin(), targets.end(), [&](auto a, auto b) { return shared.at(a) > shared.at(b); });
    return targets;
  }

  /// Joins two patches in the plane of the second; small ones also in a plane between them.
  [[nodiscard]] bool merge_into(std::uint32_t from, std::uint32_t into) {
    constexpr std::size_t kSmall = 128;
    const std::vector<std::uint32_t>& joining = patches_[from].faces;
    Patch& target = patches_[into];
    if (!extend(target, joining)) {
      if (joining.size() + target.faces.size() > kSmall) return false;
      std::vector<std::uint32_t> all = target.faces;
      all.insert(all.end(), joining.begin(), joining.end());
      Patch fresh{{}, plane_across(mean_normal(all)), PlanarTriangles(cell_)};
      if (!extend(fresh, all)) return false;
      target = std::move(fresh);
    }
    for (const std::uint32_t face : joining) patch_of_[face] = into;
    patches_[from].faces.clear();
    return true;
  }

  /// Adds all of these faces to a patch or, where one is turned away or would overlap, none.
  [[nodiscard]] bool extend(Patch& patch, const std::vector<std::uint32_t>& faces) const {
    PlanarTriangles together(cell_);  // in this plane they may come to overlap each other
    std::vector<PlanarTriangle> laid;
    for (const std::uint32_t face : faces) {
      if (!faces_plane(face, patch.plane)) return false;
      laid.push_back(projected(face, patch.plane));
      if (!patch.laid.fits(laid.back()) || !together.fits(laid.back())) return false;
      together.add(laid.back());
    }
    for (const PlanarTriangle& triangle : laid) patch.laid.add(triangle);
    patch.faces.insert(patch.faces.end(), faces.begin(), faces.end());
    return true;
  }

  [[nodiscard]] Vec3f mean_normal(const std::vector<std::uint32_t>& faces) const {
    Vec3f sum{};
    for (const std::uint32_t face : faces) sum += normals_[face] * areas_[face];
    return length(sum) > 0 ? normalized(sum) : normals_[faces.front()];
  }

  const SurfaceMesh& mesh_;
  std::vector<std::array<std::uint32_t, 3>> neighbours_;
  std::vector<std::uint32_t> patch_of_;
  std::vector<float> areas_;
  std::vector<Vec3f> normals_;
  std::vector<Patch> patches_;
  float cell_ = 1;
};

}  // namespace

bool overlap(const PlanarTriangle& a, const PlanarTriangle& b) {
  const PlanarTriangle small_a = shrunk(a), small_b = shrunk(b);
  return !an_edge_separates(small_a, small_b) && !an_edge_separates(small_b, small_a);
}

PlanarTriangles::Buckets PlanarTriangles::buckets_of(const PlanarTriangle& t) const {
  const auto bucket = [&](float value) { return std::int32_t(std::floor(value / cell_)); };
  return {bucket(std::min({t[0].x, t[1].x, t[2].x})), bucket(std::min({t[0].y, t[1].y, t[2].y})),
          bucket(std::max({t[0].x, t[1].x, t[2].x})), bucket(std::max({t[0].y, t[1].y, t[2].y}))};
}

bool PlanarTriangles::fits(const PlanarTriangle& triangle) const {
  const Buckets range = buckets_of(triangle);
  for (std::int32_t x = range.x0; x <= range.x1; ++x) {
    for (std::int32_t y = range.y0; y <= range.y1; ++y) {
      const auto bucket = buckets_.find(key(x, y));
      if (bucket == buckets_.end()) continue;
      for (const std::uint32_t other : bucket->second) {
        if (overlap(triangle, triangles_[other])) return false;
      }
    }
  }
  return true;
}

void PlanarTriangles::add(const PlanarTriangle& triangle) {
  const auto index = std::uint32_t(triangles_.size());
  triangles_.push_back(triangle);
  const Buckets range = buckets_of(triangle);
  for (std::int32_t x = range.x0; x <= range.x1; ++x) {
    for (std::int32_t y = range.y0; y <= range.y1; ++y) buckets_[key(x, y)].push_back(index);
  }
}

std::vector<UvChart> make_charts(const SurfaceMesh& mesh) {
  return ChartMaker(mesh).make();
}

}  // namespace cnerf::bake
