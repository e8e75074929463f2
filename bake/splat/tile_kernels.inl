/// The kernels of tile_kernels.h for the instruction set of the file that includes this.

#include <algorithm>
#include <cmath>

#include "bake/splat/tile_kernels.h"
#include "encoding/cpu/lanes.h"

namespace cnerf::bake::CNERF_ISA {
namespace {

using cnerf::CNERF_ISA::kWidth;
using Floats = cnerf::CNERF_ISA::Lanes::Raw;
using Ints = cnerf::CNERF_ISA::Lanes::RawI32;

/// Pixels are tested so often whether any of them still shows what comes.
constexpr std::size_t kEntriesPerTest = 16;

Floats load(const float* from) {
  return cnerf::CNERF_ISA::Lanes::load(from).raw;
}
void store(Floats value, float* to) {
  cnerf::CNERF_ISA::Lanes(value).store(to);
}
float sum(Floats value) {
  return cnerf::CNERF_ISA::sum(cnerf::CNERF_ISA::Lanes(value));
}
Floats all(float value) {
  return Floats{} + value;
}
Floats masked(Ints mask, Floats value) {
  return Floats(Ints(value) & mask);
}

/// 0, 1, 2, ...
Floats ramp() {
  Floats values{};
  for (int i = 0; i < kWidth; ++i) values[i] = float(i);
  return values;
}

/// e^x for -80 < x <= 0, to 2 units of the last place.
Floats exponential(Floats x) {
  const Floats scaled = x * 1.44269504f;
  const Floats magic = all(12582912.0f);  // 1.5 2^23: adding it rounds to whole numbers
  const Floats shifted = scaled + magic;
  const Ints whole = Ints(shifted) - Ints(magic);
  const Floats f = scaled - (shifted - magic);
  Floats power = all(0.000154035f);  // Taylor's series of 2^f, |f| <= 1/2
  power = power * f + 0.00133335581f;
  power = power * f + 0.00961812911f;
  power = power * f + 0.0555041087f;
  power = power * f + 0.240226507f;
  power = power * f + 0.693147181f;
  power = power * f + 1.0f;
  return power * Floats((whole + 127) << 23);
}

/// The part of a tile that a splat reaches: rows, and vectors of `kWidth` pixels of each.
struct Part {
  int top, bottom, first, last;
};
Part part_of(const TileSplat& splat, int left, int top) {
  const float x = splat.x - float(left) - 0.5f, y = splat.y - float(top) - 0.5f;
  const int low = std::max(0, int(std::ceil(std::max(-1.0f, y - splat.reach_y))));
  const int high = std::min(kTileSide - 1, int(std::floor(std::min(float(kTileSide), y + splat.reach_y))));
  const int begin = std::max(0, int(std::ceil(std::max(-1.0f, x - splat.reach_x))));
  const int end = std::min(kTileSide - 1, int(std::floor(std::min(float(kTileSide), x + splat.reach_x))));
  if (begin > end) return {1, 0, 1, 0};
  return {low, high, begin / kWidth * kWidth, end / kWidth * kWidth};
}

/// A splat's opacity at some pixels; 0 where it is left out.
struct Alpha {
  Floats alpha;
  Ints is_free;  ///< neither left out nor at its most
};
inline Alpha alpha_of(const TileSplat& splat, Floats dx, float dy, Floats transmittance) {
  const Floats power = (-0.5f * splat.c * dy * dy) - dx * (0.5f * splat.a * dx + splat.b * dy);
  const Ints is_shown = (power >= all(splat.least_power)) & (transmittance >= all(float(kLeastTransmittance)));
  const Floats clamped = power < all(-80.0f) ? all(-80.0f) : power;
  const Floats value = exponential(clamped < Floats{} ? clamped : Floats{}) * splat.opacity;
  const Ints is_below = value < all(float(kMostAlpha));
  return {masked(is_shown, is_below ? value : all(float(kMostAlpha))), is_shown & is_below};
}

bool is_opaque(const float* transmittance) {
  for (int i = 0; i < kTilePixels; ++i) {
    if (transmittance[i] >= float(kLeastTransmittance)) return false;
  }
  return true;
}

void draw(const TileSplat* splats, const TileEntry* list, std::size_t count, int left, int top, TilePixels& out) {
  for (int i = 0; i < kTilePixels; ++i) {
    out.rgb[0][i] = out.rgb[1][i] = out.rgb[2][i] = 0;
    out.transmittance[i] = 1;
  }
  const Floats columns = ramp() + (float(left) + 0.5f);
  for (std::size_t e = 0; e < count; ++e) {
    if (e % kEntriesPerTest == 0 && is_opaque(out.transmittance)) return;
    const TileSplat& splat = splats[list[e].splat];
    const Part part = part_of(splat, left, top);
    for (int row = part.top; row <= part.bottom; ++row) {
      const float dy = float(top + row) + 0.5f - splat.y;
      for (int column = part.first; column <= part.last; column += kWidth) {
        const int at = row * kTileSide + column;
        const Floats dx = columns + float(column) - splat.x;
        const Floats transmittance = load(out.transmittance + at);
        const Floats weight = transmittance * alpha_of(splat, dx, dy, transmittance).alpha;
        for (int c = 0; c < 3; ++c) store(load(out.rgb[c] + at) + weight * splat.color[c], out.rgb[c] + at);
        store(transmittance - weight, out.transmittance + at);
      }
    }
  }
}

/// Sums of a splat over the pixels of a tile, one per lane.
struct Sums {
  Floats p{}, px{}, py{}, pxx{}, pxy{}, pyy{}, color[3]{}, weight{};

  void add_power(Floats by_power, Floats dx, float dy) {
    const Floats by_x = by_power * dx;
    p += by_power;
    px += by_x;
    py += by_power * dy;
    pxx += by_x * dx;
    pxy += by_x * dy;
    pyy += by_power * (dy * dy);
  }
  void store_to(TileSums& out) const {
    out = {sum(p),     sum(px), sum(py), sum(pxx), sum(pxy), sum(pyy), {sum(color[0]), sum(color[1]), sum(color[2])},
           sum(weight)};
  }
};

/// What is behind the splats so far, as the loss feels it: sum_c d_c (colour behind), less the light let through.
void start_behind(const TilePixels& drawn, const TilePixels& d, float* behind) {
  for (int i = 0; i < kTilePixels; ++i) {
    behind[i] = d.transmittance[i] * drawn.transmittance[i];
    for (int c = 0; c < 3; ++c) behind[i] += d.rgb[c][i] * drawn.rgb[c][i];
  }
}

/// Front to back like `draw`, for what is behind a splat is what all have made less what those before it have.
void gradient(const TileSplat* splats, const TileEntry* list, std::size_t count, int left, int top,
              const TilePixels& drawn, const TilePixels& d, TileSums* sums) {
  alignas(64) float behind[kTilePixels];
  alignas(64) float light[kTilePixels];  // that reaches the splat
  start_behind(drawn, d, behind);
  for (float& of_pixel : light) of_pixel = 1;
  const Floats columns = ramp() + (float(left) + 0.5f);
  std::size_t e = 0;
  for (; e < count; ++e) {
    if (e % kEntriesPerTest == 0 && is_opaque(light)) break;
    const TileSplat& splat = splats[list[e].splat];
    const Part part = part_of(splat, left, top);
    Sums of_splat;
    for (int row = part.top; row <= part.bottom; ++row) {
      const float dy = float(top + row) + 0.5f - splat.y;
      for (int column = part.first; column <= part.last; column += kWidth) {
        const int at = row * kTileSide + column;
        const Floats dx = columns + float(column) - splat.x;
        const Floats transmittance = load(light + at);
        const Alpha alpha = alpha_of(splat, dx, dy, transmittance);
        const Floats weight = transmittance * alpha.alpha;
        Floats felt{};  // the loss by the splat's light
        for (int c = 0; c < 3; ++c) {
          const Floats by_color = load(d.rgb[c] + at);
          felt += by_color * splat.color[c];
          of_splat.color[c] += by_color * weight;
        }
        of_splat.weight += weight;
        const Floats rest = load(behind + at) - weight * felt;
        const Floats by_alpha = transmittance * felt - rest / (1.0f - alpha.alpha);
        of_splat.add_power(masked(alpha.is_free, by_alpha * alpha.alpha), dx, dy);
        store(rest, behind + at);
        store(transmittance - weight, light + at);
      }
    }
    of_splat.store_to(sums[list[e].place]);
  }
  for (; e < count; ++e) sums[list[e].place] = {};
}

}  // namespace

const TileKernels kTileKernels = {draw, gradient};

}  // namespace cnerf::bake::CNERF_ISA
