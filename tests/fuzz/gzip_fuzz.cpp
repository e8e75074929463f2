/// gunzip, and what gzip makes of any bytes.

#include "src/base/gzip.h"

#include <algorithm>

#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(gzip) {
  constexpr std::size_t kMost = 1 << 20;
  const auto unpacked = cnerf::gunzip(input, kMost);
  if (unpacked && unpacked->size() > kMost) throw cnerf::fuzz::Finding("more was unpacked than was asked for");
  const auto* begin = reinterpret_cast<const std::uint8_t*>(input.data());
  const auto again = cnerf::gunzip(cnerf::gzip({begin, input.size()}), kMost);
  if (!again || !std::ranges::equal(*again, std::span(begin, input.size()))) {
    throw cnerf::fuzz::Finding("what was packed is unpacked as something else");
  }
}
