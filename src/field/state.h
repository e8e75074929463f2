#pragma once
/// The mutable state of an engine as named pieces of memory, for snapshots.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace cnerf {

struct StatePiece {
  std::string name;            ///< unique within one engine
  std::span<std::byte> bytes;  ///< the memory itself: written to when a snapshot is loaded
};

template <typename T, typename Allocator>
StatePiece state_piece(std::string name, std::vector<T, Allocator>& values) {
  return {std::move(name), std::as_writable_bytes(std::span(values))};
}

}  // namespace cnerf
