#pragma once
/// The state of an engine as named pieces of memory, for snapshots.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

namespace cnerf {

struct StatePiece {
  std::string name;            ///< unique within one engine
  std::span<std::byte> bytes;  ///< the engine's own memory; loading a snapshot writes to it
  bool holds_floats = false;   ///< and nothing else

  /// False where one of its floats is infinite or not a number.
  [[nodiscard]] bool is_finite() const;
};

/// @tparam T  an integer, float, or a struct of floats
template <typename T, typename Allocator>
StatePiece state_piece(std::string name, std::vector<T, Allocator>& values) {
  return {std::move(name), std::as_writable_bytes(std::span(values)), !std::is_integral_v<T>};
}

inline bool StatePiece::is_finite() const {
  constexpr std::uint32_t kExponent = 0x7f800000;
  bool is_finite = true;
  for (std::size_t at = 0; holds_floats && at + sizeof kExponent <= bytes.size(); at += sizeof kExponent) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, bytes.data() + at, sizeof bits);
    is_finite &= (bits & kExponent) != kExponent;  // without a branch: a table has tens of millions
  }
  return is_finite;
}

}  // namespace cnerf
