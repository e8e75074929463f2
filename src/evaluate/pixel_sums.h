#pragma once
/// Sums over the pixels of a picture, on all cores.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "src/base/parallel.h"

namespace cnerf {

constexpr std::size_t kPixelsPerTask = std::size_t(1) << 15;

/// @param valid  a value per pixel, 0 where it does not count; empty: all count
inline bool counts(std::span<const std::uint8_t> valid, std::size_t pixel) {
  return valid.empty() || valid[pixel] != 0;
}

/// What `add(pixel, sum)` adds up over all pixels, in parts that `Sum::add` joins. The same on any number of threads.
template <typename Sum, typename Add>
Sum summed(std::size_t pixels, const Add& add) {
  std::vector<Sum> parts((pixels + kPixelsPerTask - 1) / kPixelsPerTask);
  parallel_ranges(pixels, kPixelsPerTask, [&](std::size_t begin, std::size_t end) {
    Sum part;
    for (std::size_t pixel = begin; pixel < end; ++pixel) add(pixel, part);
    parts[begin / kPixelsPerTask] = part;
  });
  Sum sum;
  for (const Sum& part : parts) sum.add(part);
  return sum;
}

}  // namespace cnerf
