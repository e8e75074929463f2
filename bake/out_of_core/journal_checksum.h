#pragma once
/// Checksums of the parts of `unfinished.bake`.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace cnerf::bake {

/// FNV-1a, a word at a time: finds what a killed process left half written, not what somebody forged.
/// @param seed  what the bytes have to belong to
[[nodiscard]] inline std::uint64_t checksum_of(std::span<const std::byte> bytes, std::uint64_t seed) {
  constexpr std::uint64_t kPrime = 0x100000001b3;
  std::uint64_t hash = (0xcbf29ce484222325 ^ bytes.size() ^ seed) * kPrime;
  for (std::size_t at = 0; at < bytes.size(); at += sizeof(std::uint64_t)) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, std::min(sizeof word, bytes.size() - at));
    hash = (hash ^ word) * kPrime;
    hash ^= hash >> 32;
  }
  return hash;
}

/// A part's checksum is of the bake, named by its identity, and of the part's place in it.
[[nodiscard]] inline std::uint64_t part_checksum(std::span<const std::byte> identity, std::size_t number,
                                                 std::span<const std::byte> bytes) {
  return checksum_of(bytes, checksum_of(identity, number));
}

}  // namespace cnerf::bake
