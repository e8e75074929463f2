#pragma once
/// Kernels of the field are compiled for up to 4, 8, 12 and 16 levels: 16 encoded channels are one operand of the tensor
/// cores.

#include <type_traits>

#include "src/base/check.h"

namespace cnerf {

/// Encoded channels / 16, rounded up.
constexpr int channel_tiles(int levels) {
  return (levels + 3) / 4;
}

/// Calls `work(std::integral_constant<int, channel_tiles(levels)>)`.
template <typename Work>
void with_channel_tiles(int levels, Work&& work) {
  switch (channel_tiles(levels)) {
    case 1:
      return work(std::integral_constant<int, 1>{});
    case 2:
      return work(std::integral_constant<int, 2>{});
    case 3:
      return work(std::integral_constant<int, 3>{});
    case 4:
      return work(std::integral_constant<int, 4>{});
    default:
      CNERF_CHECK(false, "the hash grid has 1 to 16 levels");
  }
}

}  // namespace cnerf
