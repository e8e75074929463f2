#pragma once
/// What a tile of a picture of splats takes, one table of functions per instruction set. Raw pointers and no checks:
/// their one caller has checked.

#include <cstddef>
#include <cstdint>

#include "src/base/cpu_features.h"

namespace cnerf::bake {

/// Opacity that a splat has at most: what lies behind it keeps a gradient.
inline constexpr double kMostAlpha = 0.99;
/// What adds less than this to a pixel is left out.
inline constexpr double kLeastAlpha = 1.0 / 255;
/// A splat ends at so many standard deviations.
inline constexpr double kReach = 3;
/// A pixel that lets less light through shows nothing of what comes behind.
inline constexpr double kLeastTransmittance = 1e-4;
inline constexpr int kTileSide = 16;
inline constexpr int kTilePixels = kTileSide * kTileSide;

/// A splat of a picture with how far it reaches.
struct TileSplat {
  float x, y;     ///< pixels
  float a, b, c;  ///< inverse covariance
  float opacity;
  float least_power;       ///< exponents below it are left out
  float reach_x, reach_y;  ///< pixels
  float color[3];
};

/// One entry of a tile's list, nearest first.
struct TileEntry {
  std::uint32_t splat;  ///< its number
  std::uint32_t place;  ///< of its sums
};

/// A tile's pixels, one plane after another. Rows of a tile that reach beyond the picture are computed as well.
struct alignas(64) TilePixels {
  float rgb[3][kTilePixels];
  float transmittance[kTilePixels];
};

/// Sums over the pixels of a tile, from which the gradient by a splat follows. `p` is the gradient by the exponent.
struct TileSums {
  float p, px, py, pxx, pxy, pyy;  ///< times dx, dy, dx^2, ...
  float color[3];
  float weight;  ///< of the pixels' light that comes from the splat
};

struct TileKernels {
  /// @param left, top  of the tile, pixels.  @param out  written
  void (*draw)(const TileSplat* splats, const TileEntry* list, std::size_t count, int left, int top, TilePixels& out);
  /// @param drawn  what `draw` made of it.  @param d  the loss by the three colours and by the transmittance
  /// @param sums   written at the places of all entries
  void (*gradient)(const TileSplat* splats, const TileEntry* list, std::size_t count, int left, int top,
                   const TilePixels& drawn, const TilePixels& d, TileSums* sums);
};

namespace generic {
extern const TileKernels kTileKernels;
}
namespace neon {
extern const TileKernels kTileKernels;
}
namespace avx2 {
extern const TileKernels kTileKernels;
}
namespace avx512 {
extern const TileKernels kTileKernels;
}

/// The kernels of `active_isa()`.
[[nodiscard]] inline const TileKernels& tile_kernels() {
  if constexpr (kHasNeon) {
    return kernels_of_isa(generic::kTileKernels, neon::kTileKernels);
  } else {
    return kernels_of_isa(generic::kTileKernels, avx2::kTileKernels, avx512::kTileKernels);
  }
}

}  // namespace cnerf::bake
