#include "src/render/occupancy_grid.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/base/rng.h"

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
  const auto n = std::size_t(layout_.cascades);
  std::size_t at = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    for (std::size_t j = 0; j < y.size(); ++j) {
      const int of_row = std::max(of_x.cascades[i], of_y.cascades[j]);
      for (std::size_t k = 0; k < z.size(); ++k) {
        const int cascade = std::max(of_row, of_z.cascades[k]);
        const auto c = std::size_t(cascade);
        const std::size_t cell =
            layout_.cell_at(cascade, of_x.cells[i * n + c], of_y.cells[j * n + c], of_z.cells[k * n + c]);
        marks[at++] = (bits_[cell / 64] >> (cell % 64)) & 1u;
      }
    }
  }
}

double OccupancyGrid::occupied_share() const {
  std::size_t count = 0;
  for (const std::uint64_t word : bits_) count += std::size_t(std::popcount(word));
  return double(count) / double(density_.size());
}

void OccupancyGrid::update(std::size_t stride, std::size_t phase, std::uint64_t jitter_seed,
                           const std::function<void(std::span<const Vec3f>, std::span<float>)>& density) {
  const std::size_t looked_at = (density_.size() - phase + stride - 1) / stride;
  const CounterRng rng = occupancy_rng(jitter_seed);
  constexpr std::size_t kPiece = 4096;
  parallel_ranges(looked_at, kPiece, [&](std::size_t begin, std::size_t end) {
    std::vector<Vec3f> points(end - begin);
    std::vector<float> sigma(end - begin);
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t cell = phase + i * stride;
      const Vec3f jitter = {rng.uniform(3 * cell), rng.uniform(3 * cell + 1), rng.uniform(3 * cell + 2)};
      points[i - begin] = layout_.point_in(cell, jitter);
    }
    density(points, sigma);
    for (std::size_t i = begin; i < end; ++i) {
      float& remembered = density_[phase + i * stride];
      if (remembered == kExcludedCell) continue;
      const float before = remembered == kNeverSeenCell ? 0.0f : remembered * options_.decay;
      remembered = std::max(before, sigma[i - begin]);
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
  const std::size_t blocks_a_side = r / kBlockSide;
  std::fill(blocks_.begin(), blocks_.end(), std::uint8_t(0));
  parallel_tasks(std::size_t(layout_.cascades), [&](std::size_t k) {
    const float* density = density_.data() + k * cells;
    // Early in training nothing reaches the threshold; then cells denser than the mean are what is worth sampling.
    double total = 0;
    std::size_t included = 1;
    for (std::size_t i = 0; i < cells; ++i) {
      if (density[i] == kExcludedCell) continue;
      total += std::min(density[i], 1e4f);
      ++included;
    }
    const float threshold = std::min(options_.optical_thickness / cell_side(int(k)), float(total / double(included)));
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
      blocks_[((k * blocks_a_side + z / kBlockSide) * blocks_a_side + y / kBlockSide) * blocks_a_side +
              x / kBlockSide] = 1;
    }
  });
}

}  // namespace cnerf
