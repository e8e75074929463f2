#pragma once
/// gzip, which browsers undo by themselves and whose checksum they verify.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace cnerf {

/// One gzip member at the highest level, tuned for differences of neighbours. The same bytes give the same result: no
/// name, no time.
[[nodiscard]] std::vector<std::byte> gzip(std::span<const std::uint8_t> bytes);

/// What one gzip member holds. Nothing when it is damaged, cut short, or holds more than `most` bytes.
[[nodiscard]] std::optional<std::vector<std::uint8_t>> gunzip(std::span<const std::byte> packed, std::size_t most);

}  // namespace cnerf
