#pragma once
/// gzip, which browsers decompress and verify by themselves.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace cnerf {

/// One gzip member at the highest level, with the filter strategy for differences of neighbours. Deterministic: the
/// header holds neither name nor time.
[[nodiscard]] std::vector<std::byte> gzip(std::span<const std::uint8_t> bytes);

/// The content of one gzip member; nothing when it is damaged, cut short, or longer than `most` bytes.
[[nodiscard]] std::optional<std::vector<std::uint8_t>> gunzip(std::span<const std::byte> packed, std::size_t most);

}  // namespace cnerf
