#include "src/train/luminance/depth_hints.h"

#include <algorithm>
#include <cmath>

#include "src/base/parallel.h"
#include "src/train/luminance/believed_points.h"

namespace cnerf {
namespace {

constexpr int kHintsAcross = 64;        // cells along the longer side of a picture
constexpr double kReach = 6;            // cells, from a point to where it tells anything
constexpr std::size_t kNeighbours = 4;  // points that tell of a cell
constexpr double kExactness = 0.05;     // of the logarithm of distances, at a point: a cell is not one pixel
constexpr double kSlope = 0.1;          // per cell from the nearest point, likewise
constexpr double kWidest = 0.5;         // likewise: more is not worth saying

/// A point in a picture.
struct ShownPoint {
  double x = 0, y = 0;  ///< cells
  double log_distance = 0;
};

class HintedView {
 public:
  HintedView(const View& view, const SceneFrame& frame, const std::vector<Vec3d>& points) {
    const Intrinsics& lens = view.intrinsics;
    const double cells_per_pixel = double(kHintsAcross) / std::max(lens.width, lens.height);
    hints_.columns = std::max(1, int(std::ceil(lens.width * cells_per_pixel)));
    hints_.rows = std::max(1, int(std::ceil(lens.height * cells_per_pixel)));
    const double across = double(hints_.columns) / lens.width, down = double(hints_.rows) / lens.height;
    const Affined camera_from_world = view.world_from_camera.inverse();
    for (const Vec3d& point : points) {
      const Vec3d at = camera_from_world.point(point);
      const double distance = length(at) * frame.unit_per_world;
      const auto pixel = project(lens, at);
      if (pixel && distance > 0) points_.push_back({pixel->x * across, pixel->y * down, std::log(distance)});
    }
  }

  [[nodiscard]] DepthHints hints() && {
    for (int y = 0; y < hints_.rows; ++y) {
      for (int x = 0; x < hints_.columns; ++x) hints_.cells.push_back(hint_at(x + 0.5, y + 0.5));
    }
    return std::move(hints_);
  }

 private:
  [[nodiscard]] DepthHint hint_at(double x, double y) const {
    struct Neighbour {
      double squared, log_distance;
    };
    std::vector<Neighbour> near;
    for (const ShownPoint& point : points_) {
      const double dx = point.x - x, dy = point.y - y;
      if (dx * dx + dy * dy < kReach * kReach) near.push_back({dx * dx + dy * dy, point.log_distance});
    }
    if (near.empty()) return {};
    const std::size_t count = std::min(kNeighbours, near.size());
    std::ranges::partial_sort(near, near.begin() + std::ptrdiff_t(count), {}, &Neighbour::squared);
    const double scale = std::max(near[count - 1].squared, 1.0);
    double weights = 0, mean = 0, spread = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const double weight = std::exp(-2 * near[i].squared / scale);
      weights += weight;
      mean += weight * near[i].log_distance;
    }
    mean /= weights;
    for (std::size_t i = 0; i < count; ++i) {
      const double off = near[i].log_distance - mean;
      spread += std::exp(-2 * near[i].squared / scale) * off * off;
    }
    const double width = std::sqrt(kExactness * kExactness + kSlope * kSlope * near.front().squared + spread / weights);
    return width > kWidest ? DepthHint{} : DepthHint{float(mean), float(1 / width)};
  }

  DepthHints hints_;
  std::vector<ShownPoint> points_;
};

}  // namespace

std::vector<DepthHints> depth_hints(const Capture& capture, const SceneFrame& frame,
                                    const std::vector<SparsePoint>& points) {
  const std::vector<std::vector<Vec3d>> shown = believed_points(capture.views.size(), points);
  std::vector<std::size_t> training;
  for (std::size_t v = 0; v < shown.size(); ++v) {
    if (!capture.views[v].held_out) training.push_back(v);
  }
  if (std::ranges::all_of(training, [&](std::size_t v) { return shown[v].empty(); })) return {};
  std::vector<DepthHints> hints(training.size());
  parallel_tasks(training.size(), [&](std::size_t i) {
    const std::size_t v = training[i];
    if (!shown[v].empty()) hints[i] = HintedView(capture.views[v], frame, shown[v]).hints();
  });
  return hints;
}

void show_to(std::vector<TrainingView>& views, const std::vector<DepthHints>& hints) {
  for (std::size_t v = 0; v < hints.size(); ++v) {
    if (!hints[v].cells.empty()) views[v].depths = &hints[v];
  }
}

}  // namespace cnerf
