#pragma once
/// Light that differs over a picture: logarithms of gains on a lattice over it, read between its nodes. A shadow that
/// moves, a cloud, a lens that is darker at its corners (bilateral guided radiance fields, Wang et al. 2024, without
/// their third axis).

#include <cmath>

#include "src/base/host_device.h"

namespace cnerf {

inline constexpr int kGainAcross = 6;  ///< nodes of an axis, the outer ones on the picture's border
inline constexpr int kGainNodes = kGainAcross * kGainAcross;

/// A place in a picture, both in [0, 1].
struct PicturePlace {
  float u = 0, v = 0;
};

/// Zeros leave a view as it is. Also its gradient and its moments.
struct GainField {
  float log_gain[kGainNodes] = {};  ///< [rows, columns]

  CNERF_HD GainField& operator+=(const GainField& other) {
    for (int n = 0; n < kGainNodes; ++n) log_gain[n] += other.log_gain[n];
    return *this;
  }
};

/// The four nodes around a place, and their shares.
struct GainCorners {
  int column = 0, row = 0;    ///< of the first
  float right = 0, down = 0;  ///< shares of the second column and row

  CNERF_HD explicit GainCorners(PicturePlace at) {
    const float x = at.u * float(kGainAcross - 1), y = at.v * float(kGainAcross - 1);
    column = x < 0 ? 0 : x >= float(kGainAcross - 1) ? kGainAcross - 2 : int(x);
    row = y < 0 ? 0 : y >= float(kGainAcross - 1) ? kGainAcross - 2 : int(y);
    right = x - float(column);
    down = y - float(row);
  }
  /// @param i  of 0 to 3
  [[nodiscard]] CNERF_HD int node(int i) const { return (row + i / 2) * kGainAcross + column + i % 2; }
  [[nodiscard]] CNERF_HD float share(int i) const {
    return (i % 2 == 0 ? 1 - right : right) * (i / 2 == 0 ? 1 - down : down);
  }
  [[nodiscard]] CNERF_HD float log_gain_of(const GainField& field) const {
    float sum = 0;
    for (int i = 0; i < 4; ++i) sum += share(i) * field.log_gain[node(i)];
    return sum;
  }
};

}  // namespace cnerf
