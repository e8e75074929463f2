// The CPU kernels, written once over lanes and compiled once per instruction set. See hash_grid_kernels.h.

#include "encoding/cpu/hash_grid_kernels.h"
#include "encoding/cpu/lanes.h"
#include "encoding/hash_grid_math.h"

namespace cnerf::CNERF_ISA {
namespace {

/// Rows and weights of the 8 corners of a group's samples, at one level.
struct GroupCorners {
  alignas(64) std::uint32_t row[8][kGroup];
  alignas(64) float weight[8][kGroup];
};

inline void find_corners(const GridLevel& level, const float* positions, GroupCorners& corners) {
  for (int first = 0; first < kGroup; first += kWidth) {
    const Lanes position[3] = {Lanes::load(positions + first), Lanes::load(positions + kGroup + first),
                               Lanes::load(positions + 2 * kGroup + first)};
    for_each_corner<LanesU32>(level, position, [&](std::uint32_t corner, LanesU32 row, Lanes weight) {
      row.store(&corners.row[corner][first]);
      weight.store(&corners.weight[corner][first]);
    });
  }
}

void encode(const GridLevel* levels, std::size_t n_levels, const float* table, const float* positions,
            std::size_t groups, float* encoded, int channels) {
  GroupCorners corners;
  for (std::size_t g = 0; g < groups; ++g) {
    float* out = encoded + g * std::size_t(channels) * kGroup;
    for (std::size_t l = 0; l < n_levels; ++l) {
      const GridLevel& level = levels[l];
      find_corners(level, positions + g * 3 * kGroup, corners);
      const float* rows = table + 4 * std::size_t(level.first_row);
      for (int s = 0; s < kGroup; s += 4) {
        Row4 features[4];
        for (int i = 0; i < 4; ++i) {
          Row4 total = Row4::zero();
          for (int c = 0; c < 8; ++c) {
            total = fma(corners.weight[c][s + i], Row4::load(rows + 4 * std::size_t(corners.row[c][s + i])), total);
          }
          features[i] = total;
        }
        transpose(features[0], features[1], features[2], features[3]);
        for (int f = 0; f < 4; ++f) features[f].store(out + f * kGroup + s);
      }
      out += 4 * kGroup;
    }
  }
}

/// Gradients of the corners of one cell, gathered over successive samples in it.
struct CellRun {
  Row4 sum[8];
  std::uint32_t row[8];

  void start(const GroupCorners& corners, int sample) {
    for (int c = 0; c < 8; ++c) {
      sum[c] = Row4::zero();
      row[c] = corners.row[c][sample];
    }
  }
  void write(float* d_rows) const {
    for (int c = 0; c < 8; ++c) {
      float* to = d_rows + 4 * std::size_t(row[c]);
      (Row4::load(to) + sum[c]).store(to);
    }
  }
  /// A cell is known by its lowest and its highest corner's rows: two cells that share both hash alike on them and are
  /// told apart by a third corner.
  bool holds(const GroupCorners& corners, int sample) const {
    return row[0] == corners.row[0][sample] && row[7] == corners.row[7][sample] && row[1] == corners.row[1][sample] &&
           row[2] == corners.row[2][sample] && row[4] == corners.row[4][sample];
  }
};

void scatter_level(const GridLevel& level, const float* positions, const float* d_encoded, std::size_t groups,
                   int channels, int first_channel, float* d_rows) {
  if (groups == 0) return;
  GroupCorners corners;
  CellRun run;
  for (std::size_t g = 0; g < groups; ++g) {
    find_corners(level, positions + g * 3 * kGroup, corners);
    if (g == 0) run.start(corners, 0);
    const float* d_group = d_encoded + (g * std::size_t(channels) + std::size_t(first_channel)) * kGroup;
    for (int s = 0; s < kGroup; s += 4) {
      Row4 d_features[4];
      for (int f = 0; f < 4; ++f) d_features[f] = Row4::load(d_group + f * kGroup + s);
      transpose(d_features[0], d_features[1], d_features[2], d_features[3]);
      for (int i = 0; i < 4; ++i) {
        if (!run.holds(corners, s + i)) {
          run.write(d_rows);
          run.start(corners, s + i);
        }
        for (int c = 0; c < 8; ++c) run.sum[c] = fma(corners.weight[c][s + i], d_features[i], run.sum[c]);
      }
    }
  }
  run.write(d_rows);
}

/// d_features . rows of the 8 corners, for each sample of a group.
inline void project_corners(const GroupCorners& corners, const float* rows, const float* d_group,
                            float projected[8][kGroup]) {
  for (int s = 0; s < kGroup; s += 4) {
    Row4 d_features[4];
    for (int f = 0; f < 4; ++f) d_features[f] = Row4::load(d_group + f * kGroup + s);
    transpose(d_features[0], d_features[1], d_features[2], d_features[3]);
    for (int c = 0; c < 8; ++c) {
      Row4 product[4];
      for (int i = 0; i < 4; ++i) {
        product[i] = Row4::load(rows + 4 * std::size_t(corners.row[c][s + i])) * d_features[i];
      }
      transpose(product[0], product[1], product[2], product[3]);
      ((product[0] + product[1]) + (product[2] + product[3])).store(&projected[c][s]);
    }
  }
}

void position_gradient(const GridLevel* levels, std::size_t n_levels, const float* table, const float* positions,
                       const float* d_encoded, std::size_t groups, int channels, float* d_positions) {
  GroupCorners corners;
  alignas(64) float projected[8][kGroup];
  for (std::size_t g = 0; g < groups; ++g) {
    const float* position = positions + g * 3 * kGroup;
    float* d_position = d_positions + g * 3 * kGroup;
    for (int i = 0; i < 3 * kGroup; ++i) d_position[i] = 0;
    for (std::size_t l = 0; l < n_levels; ++l) {
      const GridLevel& level = levels[l];
      find_corners(level, position, corners);
      project_corners(corners, table + 4 * std::size_t(level.first_row),
                      d_encoded + (g * std::size_t(channels) + 4 * l) * kGroup, projected);
      for (int first = 0; first < kGroup; first += kWidth) {
        const Lanes place[3] = {Lanes::load(position + first), Lanes::load(position + kGroup + first),
                                Lanes::load(position + 2 * kGroup + first)};
        Lanes at_corner[8], slope[3];
        for (int c = 0; c < 8; ++c) at_corner[c] = Lanes::load(&projected[c][first]);
        trilinear_slope(locate<LanesU32>(level, place).fraction, at_corner, slope);
        const Lanes cells(float(level.cells));
        for (int axis = 0; axis < 3; ++axis) {
          float* to = d_position + axis * kGroup + first;
          (Lanes::load(to) + cells * slope[axis]).store(to);
        }
      }
    }
  }
}

}  // namespace

const HashGridKernels kHashGridKernels = {encode, scatter_level, position_gradient};

}  // namespace cnerf::CNERF_ISA
