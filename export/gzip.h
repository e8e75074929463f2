#pragma once
/// Bytes -> gzip, which browsers undo by themselves and whose checksum they verify.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace cnerf {

/// One gzip member at the highest level, tuned for differences of neighbours. The same bytes give the same result: no name, no time.
[[nodiscard]] std::vector<std::byte> gzip(std::span<const std::uint8_t> bytes);

}  // namespace cnerf
