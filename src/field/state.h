#pragma once
/// The state of an engine as named pieces of memory, for snapshots.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace cnerf {

struct StatePiece {
  std::string name;            ///< unique within one engine
  std::span<std::byte> bytes;  ///< the engine's own memory; loading a snapshot writes to it
};

template <typename T, typename Allocator>
StatePiece state_piece(std::string name, std::vector<T, Allocator>& values) {
  return {std::move(name), std::as_writable_bytes(std::span(values))};
}

}  // namespace cnerf
