#pragma once
/// Snapshots out of fuzz inputs: with their checksums mended, so that a reader sees what lies behind them.

#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <vector>

#include "src/base/files.h"
#include "src/train/luminance/snapshot.h"
#include "tests/fuzz/fuzz_target.h"

namespace cnerf::fuzz {

/// The bytes of all pieces that a header lists; nothing where it lists none, or more than inputs are worth.
inline std::size_t bytes_of_pieces(Bytes header) {
  constexpr std::size_t kMost = std::size_t(1) << 23;
  const auto json = nlohmann::json::parse(text_of(header), nullptr, /*allow_exceptions=*/false, true);
  std::size_t sum = 0;
  if (!json.is_object() || !json.contains("pieces")) return 0;
  for (const auto& piece : json["pieces"]) {
    if (!piece.is_object() || !piece.contains("bytes") || !piece["bytes"].is_number_unsigned()) continue;
    sum = std::min(kMost, sum) + std::min(kMost, piece["bytes"].get<std::size_t>());
  }
  return std::min(sum, kMost);
}

/// By the first byte: the file as it is, the file but for its checksum, or its header only, with pieces of zeros.
inline std::vector<std::byte> snapshot_of(Bytes input) {
  const unsigned kind = take_byte(input) % 3;
  std::vector<std::byte> content;
  if (kind < 2) {
    append_bytes(content, input);
    if (kind == 0) return content;
  } else {
    append_bytes(content, bytes_of("CNERFSNP"));
    append_value(content, kSnapshotVersion);
    append_value(content, std::uint64_t(input.size()));
    append_bytes(content, input);
    content.resize(content.size() + bytes_of_pieces(input));
  }
  append_bytes(content, bytes_of(sha256(content)));
  return content;
}

}  // namespace cnerf::fuzz
