#include "src/render/occupancy_grid.h"

#include <algorithm>
#include <cmath>

#include "src/base/check.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

constexpr int kBlockSide = 8;

}  // namespace

OccupancyGrid::OccupancyGrid(const OccupancyOptions& options, int cascades)
    : options_(options), layout_(options.resolution, cascades) {
  CNERF_CHECK(options.resolution % (2 * kBlockSide) == 0,
              "occupancy resolution must be a multiple of 16, so that blocks do not straddle cascades");
  CNERF_CHECK(cascades >= 1, "at least one cascade");
  const std::size_t cells = std::size_t(options.resolution) * options.resolution * options.resolution * cascades;
  density_.assign(cells, kNeverSeenCell);
  bits_.assign((cells + 63) / 64, ~std::uint64_t(0));
  blocks_.assign(cells / (kBlockSide * kBlockSide * kBlockSide), 1);
}

void OccupancyGrid::mark_occupied(std::span<const float> x, std::span<const float> y, std::span<const float> z,
                                  std::span<std::uint8_t> marks) const {
  CNERF_CHECK_EQ(marks.size(), x.size() * y.size() * z.size());
  struct Axis {
    std::vector<int> cascades;
    std::vector<std::size_t> cells;  // [coordinates][cascades]
  };
  const auto axis_of = [&](std::span<const float> coordinates) {
    Axis axis;
    for (const float c : coordinates) {
      axis.cascades.push_back(layout_.cascade_of(c));
      for (int k = 0; k < layout_.cascades; ++k) axis.cells.push_back(layout_.cell_along(k, c));
    }
    return axis;
  };
  const Axis of_x = axis_of(x), of_y = axis_of(y), of_z = axis_of(z);
  const auto n = std::size_t(layout_.cascades), rows = y.size(), plane = rows * z.size();
  // Coordinates are closer than cells, mostly: what lies in the same cells as its neighbour has its marks.
  const auto is_as_before = [n](const Axis& axis, std::size_t i) {
    const auto cells = axis.cells.begin() + std::ptrdiff_t(i * n);
    return i > 0 && axis.cascades[i] == axis.cascades[i - 1] &&
           std::equal(cells, cells + std::ptrdiff_t(n), cells - std::ptrdiff_t(n));
  };
  for (std::size_t i = 0; i < x.size(); ++i) {
    std::uint8_t* const of_plane = marks.data() + i * plane;
    if (is_as_before(of_x, i)) {
      std::copy_n(of_plane - plane, plane, of_plane);
      continue;
    }
    for (std::size_t j = 0; j < rows; ++j) {
      std::uint8_t* const of_row = of_plane + j * z.size();
      if (is_as_before(of_y, j)) {
        std::copy_n(of_row - z.size(), z.size(), of_row);
        continue;
      }
      const int cascade_of_row = std::max(of_x.cascades[i], of_y.cascades[j]);
      for (std::size_t k = 0; k < z.size(); ++k) {
        const int cascade = std::max(cascade_of_row, of_z.cascades[k]);
        const auto c = std::size_t(cascade);
        const std::size_t cell =
            layout_.cell_at(cascade, of_x.cells[i * n + c], of_y.cells[j * n + c], of_z.cells[k * n + c]);
        of_row[k] = (bits_[cell / 64] >> (cell % 64)) & 1u;
      }
    }
  }
}

void OccupancyGrid::update(const OccupancyUpdate& update,
                           const std::function<void(std::span<const Vec3f>, std::span<float>)>& density) {
  constexpr std::size_t kPiece = 4096;
  parallel_ranges(update.count(density_.size()), kPiece, [&](std::size_t begin, std::size_t end) {
    std::vector<Vec3f> points(end - begin);
    std::vector<float> sigma(end - begin);
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t cell = update.cell(i);
      points[i - begin] = layout_.point_in(cell, update.place_in(cell));
    }
    density(points, sigma);
    for (std::size_t i = begin; i < end; ++i) {
      float& remembered = density_[update.cell(i)];
      remembered = remembered_density(remembered, sigma[i - begin], options_.decay);
    }
  });
  refresh_bits();
}

void OccupancyGrid::exclude(const std::function<bool(Vec3f, float)>& wanted) {
  constexpr int kSide = 4;
  const int r = options_.resolution;
  parallel_tasks(std::size_t(layout_.cascades * r / kSide), [&](std::size_t slab) {
    const int k = int(slab) / (r / kSide), z0 = int(slab) % (r / kSide) * kSide;
    const float radius = 0.5f * std::sqrt(3.0f) * kSide * cell_side(k);
    for (int y0 = 0; y0 < r; y0 += kSide) {
      for (int x0 = 0; x0 < r; x0 += kSide) {
        const Vec3f in_cells = {float(x0) + 0.5f * kSide, float(y0) + 0.5f * kSide, float(z0) + 0.5f * kSide};
        const Vec3f centre =
            (in_cells / float(r) - Vec3f{0.5f, 0.5f, 0.5f}) * layout_.side(k) + Vec3f{0.5f, 0.5f, 0.5f};
        if (wanted(centre, radius)) continue;
        for (int z = z0; z < z0 + kSide; ++z) {
          for (int y = y0; y < y0 + kSide; ++y) {
            float* row = density_.data() + ((std::size_t(k) * r + z) * r + y) * r + x0;
            std::fill(row, row + kSide, kExcludedCell);
          }
        }
      }
    }
  });
  refresh_bits();
}

void OccupancyGrid::refresh_bits() {
  const std::size_t r = std::size_t(options_.resolution);
  const std::size_t cells = r * r * r;
  const std::size_t blocks_per_side = r / kBlockSide;
  std::fill(blocks_.begin(), blocks_.end(), std::uint8_t(0));
  parallel_tasks(std::size_t(layout_.cascades), [&](std::size_t k) {
    const float* density = density_.data() + k * cells;
    MeanDensity<double> mean;
    for (std::size_t i = 0; i < cells; ++i) mean.add(density[i]);
    const float threshold = occupancy_threshold(options_.optical_thickness, cell_side(int(k)), mean.value());
    for (std::size_t word = 0; word < cells / 64; ++word) {
      std::uint64_t bits = 0;
      for (std::size_t bit = 0; bit < 64; ++bit) {
        if (density[word * 64 + bit] > threshold) bits |= std::uint64_t(1) << bit;
      }
      bits_[k * (cells / 64) + word] = bits;
    }
    for (std::size_t i = 0; i < cells; i += kBlockSide) {
      const std::size_t word = (k * cells + i) / 64;
      if (((bits_[word] >> (i % 64)) & 0xffu) == 0) continue;
      const std::size_t x = i % r, y = i / r % r, z = i / (r * r);
      blocks_[((k * blocks_per_side + z / kBlockSide) * blocks_per_side + y / kBlockSide) * blocks_per_side +
              x / kBlockSide] = 1;
    }
  });
}

}  // namespace cnerf
