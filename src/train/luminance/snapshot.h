#pragma once
/// Snapshots: a JSON header and named pieces of memory, written whole or not at all.
///
/// Layout: "CNERFSNP", u32 format version, u64 header size, header (UTF-8 JSON), the pieces one after another in the
/// header's order, then 64 hex digits of the SHA-256 of all before. Little-endian.

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "src/base/error.h"
#include "src/base/json.h"
#include "src/base/observer.h"
#include "src/field/state.h"

namespace cnerf {

inline constexpr std::uint32_t kSnapshotVersion = 2;  // 2: the luminance net answers in L*

/// @param header  gains "kind" and "pieces".
void save_snapshot(const std::filesystem::path& file, const std::string& kind, nlohmann::json header,
                   const std::vector<StatePiece>& pieces);

/// A snapshot read from disk and checked; `restore` copies pieces into an engine's memory.
class Snapshot {
 public:
  /// @throws MissingInputError, SnapshotError  not a snapshot, of another kind or version, cut short, or damaged.
  Snapshot(const std::filesystem::path& file, const std::string& kind);

  [[nodiscard]] const nlohmann::json& header() const { return header_; }
  /// @throws SnapshotError  when a piece is missing or of another size than the engine's.
  void restore(const std::vector<StatePiece>& pieces) const;
  /// The bytes of one piece.  @throws SnapshotError  when there is none of that name
  [[nodiscard]] std::span<const std::byte> piece(const std::string& name) const;
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  /// Of the file.
  [[nodiscard]] std::size_t bytes() const { return content_.size(); }

 private:
  std::filesystem::path file_;
  std::vector<std::byte> content_;
  std::size_t pieces_begin_ = 0;
  nlohmann::json header_;
};

/// Says to somebody who goes on with a snapshot that the rest is not bit for bit what it would have been: unless the
/// kernels are the same, or the snapshot does not name its own.
void say_kernels(const std::filesystem::path& file, const std::string& before, const std::string& now,
                 Observer& observer);

/// Seconds that went into a snapshot, by name, in a file beside it: a snapshot depends on its input alone, bit for bit,
/// which no clock does. Nothing is read where the file is missing or damaged.
using SnapshotTimes = std::map<std::string, double>;
void save_times(const std::filesystem::path& snapshot, const SnapshotTimes& times);
[[nodiscard]] SnapshotTimes load_times(const std::filesystem::path& snapshot);

/// The value of a header field.  @throws SnapshotError naming file and field when it is missing or of another type.
template <typename T>
T header_field(const Snapshot& snapshot, const std::string& field) {
  try {
    T value;
    read_exactly(snapshot.header().at(field), value);
    return value;
  } catch (const nlohmann::json::exception& problem) {
    throw SnapshotError(snapshot.file().string() + ": header field '" + field + "': " + problem.what());
  }
}

/// What `read` makes of the header.  @throws SnapshotError  naming the file, in place of nlohmann::json::exception
template <typename Read>
auto from_header(const Snapshot& snapshot, const Read& read) {
  try {
    return read(snapshot.header());
  } catch (const nlohmann::json::exception& problem) {
    throw SnapshotError(snapshot.file().string() + ": header: " + problem.what());
  }
}

}  // namespace cnerf
