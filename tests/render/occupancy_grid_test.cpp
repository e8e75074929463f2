// Looking up the points of a lattice against looking them up one by one.

#include "src/render/occupancy_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "src/base/rng.h"

namespace cnerf {
namespace {

/// Matter in a ball that is off the middle, so that every cascade has cells of both kinds.
OccupancyGrid ball(int cascades) {
  OccupancyOptions options;
  options.resolution = 32;
  OccupancyGrid grid(options, cascades);
  for (std::size_t phase = 0; phase < 2; ++phase) {
    grid.update({2, phase, 7}, [](std::span<const Vec3f> points, std::span<float> sigma) {
      for (std::size_t i = 0; i < points.size(); ++i) {
        sigma[i] = length(points[i] - Vec3f{0.45f, 0.5f, 0.62f}) < 0.2f ? 1000.0f : 0.0f;
      }
    });
  }
  return grid;
}

TEST(OccupancyGrid, ALatticeIsItsPoints) {
  for (const int cascades : {1, 3}) {
    const OccupancyGrid grid = ball(cascades);
    SequentialRng rng(3, 1);
    std::vector<float> axes[3];
    for (std::size_t a = 0; a < 3; ++a) {
      axes[a] = {0.0f, 0.25f, 0.375f, 0.5f, 0.625f, 1.0f};  // faces of cascades among them
      for (int i = 0; i < 20 + int(a); ++i) axes[a].push_back(rng.uniform(0.0f, 1.0f));
    }
    const auto& [x, y, z] = axes;
    std::vector<std::uint8_t> marks(x.size() * y.size() * z.size());
    grid.mark_occupied(x, y, z, marks);
    std::size_t at = 0;
    for (const float px : x) {
      for (const float py : y) {
        for (const float pz : z) {
          const Vec3f p{px, py, pz};
          ASSERT_EQ(marks[at++] != 0, grid.occupied(grid.cascade_of(p), p)) << px << ' ' << py << ' ' << pz;
        }
      }
    }
    EXPECT_GT(std::ranges::count(marks, 1), 100);
    EXPECT_GT(std::ranges::count(marks, 0), 100);
  }
}

}  // namespace
}  // namespace cnerf
