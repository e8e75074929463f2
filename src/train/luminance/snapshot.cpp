#include "src/train/luminance/snapshot.h"

#include <cstring>

#include "src/base/files.h"
#include "src/base/json.h"

namespace cnerf {
namespace {

constexpr std::string_view kMagic = "CNERFSNP";
constexpr std::size_t kDigestSize = 64;
constexpr std::size_t kFixedSize = kMagic.size() + sizeof(std::uint32_t) + sizeof(std::uint64_t);

template <typename T>
void append_value(std::vector<std::byte>& to, const T& value) {
  const auto* bytes = reinterpret_cast<const std::byte*>(&value);
  to.insert(to.end(), bytes, bytes + sizeof value);
}

void append_text(std::vector<std::byte>& to, std::string_view text) {
  const auto* bytes = reinterpret_cast<const std::byte*>(text.data());
  to.insert(to.end(), bytes, bytes + text.size());
}

template <typename T>
T read_at(const std::vector<std::byte>& from, std::size_t offset) {
  T value;
  std::memcpy(&value, from.data() + offset, sizeof value);
  return value;
}

}  // namespace

void save_snapshot(const std::filesystem::path& file, const std::string& kind, nlohmann::json header,
                   const std::vector<StatePiece>& pieces) {
  for (const StatePiece& piece : pieces) {
    if (piece.is_finite()) continue;
    throw DivergedError(file.string() + ": not written, what is there stays: the training's " + piece.name +
                        " holds numbers that are not finite");
  }
  header["kind"] = kind;
  header["pieces"] = nlohmann::json::array();
  for (const StatePiece& piece : pieces) {
    header["pieces"].push_back({{"name", piece.name}, {"bytes", piece.bytes.size()}});
  }
  const std::string text = header.dump();
  std::vector<std::byte> content;
  std::size_t bytes = kFixedSize + text.size() + kDigestSize;
  for (const StatePiece& piece : pieces) bytes += piece.bytes.size();
  content.reserve(bytes);
  append_text(content, kMagic);
  append_value(content, kSnapshotVersion);
  append_value(content, std::uint64_t(text.size()));
  append_text(content, text);
  for (const StatePiece& piece : pieces) content.insert(content.end(), piece.bytes.begin(), piece.bytes.end());
  append_text(content, sha256(content));
  write_file(file, content);
}

Snapshot::Snapshot(const std::filesystem::path& file, const std::string& kind)
    : file_(file), content_(read_binary_file(file)) {
  const auto fail = [&](const std::string& problem) { throw SnapshotError(file.string() + ": " + problem); };
  if (content_.size() < kFixedSize || std::memcmp(content_.data(), kMagic.data(), kMagic.size()) != 0) {
    fail("not a cnerf snapshot, or cut short");
  }
  const auto version = read_at<std::uint32_t>(content_, kMagic.size());
  if (version != kSnapshotVersion) {
    fail("format version " + std::to_string(version) + ", this program reads version " +
         std::to_string(kSnapshotVersion));
  }
  const auto header_size = read_at<std::uint64_t>(content_, kMagic.size() + sizeof version);
  if (header_size > content_.size() - kFixedSize) fail("cut short: the header is incomplete");
  pieces_begin_ = kFixedSize + header_size;
  try {
    header_ = parse_json<SnapshotError, nlohmann::json>(
        {reinterpret_cast<const char*>(content_.data()) + kFixedSize, header_size}, file_);
    std::size_t expected = pieces_begin_ + kDigestSize;
    if (!header_.at("pieces").is_array()) fail("damaged header: its pieces are no list");
    for (const auto& piece : header_.at("pieces")) {
      (void)piece.at("name").get_ref<const std::string&>();
      // Sizes that no file has could add up to this one's; a fraction is no size.
      const auto bytes = piece.at("bytes").get_ref<const nlohmann::json::number_unsigned_t&>();
      if (bytes > content_.size()) fail("cut short: a piece of " + std::to_string(bytes) + " bytes is incomplete");
      expected += bytes;
    }
    if (content_.size() != expected) {
      fail("cut short: " + std::to_string(content_.size()) + " bytes, expected " + std::to_string(expected));
    }
    if (header_.at("kind") != kind) {
      fail("is a snapshot of kind " + excerpt(header_.at("kind")) + ", expected '" + kind + "'");
    }
  } catch (const nlohmann::json::exception& problem) {
    fail(std::string("damaged header: ") + problem.what());
  }
  const std::size_t signed_size = content_.size() - kDigestSize;
  const std::string digest = sha256(std::span(content_).first(signed_size));
  if (std::memcmp(digest.data(), content_.data() + signed_size, kDigestSize) != 0) fail("damaged: checksum mismatch");
}

std::span<const std::byte> Snapshot::piece(const std::string& name) const {
  std::size_t offset = pieces_begin_;
  for (const nlohmann::json& stored : header_.at("pieces")) {
    const auto bytes = stored.at("bytes").get<std::size_t>();
    if (stored.at("name") == name) return std::span(content_).subspan(offset, bytes);
    offset += bytes;
  }
  throw SnapshotError(file_.string() + ": holds no piece '" + name + "'");
}

void Snapshot::restore(const std::vector<StatePiece>& pieces) const {
  std::size_t offset = pieces_begin_;
  const auto& stored = header_.at("pieces");
  if (stored.size() != pieces.size()) {
    throw SnapshotError(file_.string() + ": holds " + std::to_string(stored.size()) + " pieces, expected " +
                        std::to_string(pieces.size()));
  }
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const auto name = stored[i].at("name").get<std::string>();
    const auto bytes = stored[i].at("bytes").get<std::size_t>();
    if (name != pieces[i].name || bytes != pieces[i].bytes.size()) {
      throw SnapshotError(file_.string() + ": piece " + excerpt(stored[i].at("name")) + " of " + std::to_string(bytes) +
                          " bytes, expected '" + pieces[i].name + "' of " + std::to_string(pieces[i].bytes.size()));
    }
    std::memcpy(pieces[i].bytes.data(), content_.data() + offset, bytes);
    offset += bytes;
    if (!pieces[i].is_finite()) {
      throw SnapshotError(file_.string() + ": piece '" + name + "' holds numbers that are not finite");
    }
  }
}

namespace {

std::filesystem::path times_file(const std::filesystem::path& snapshot) {
  return std::filesystem::path(snapshot).replace_extension(".seconds.json");
}

}  // namespace

void say_kernels(const std::filesystem::path& file, const std::string& before, const std::string& now,
                 Observer& observer) {
  if (before.empty() || before == now) return;
  observer.say("note: " + file.string() + " was trained with kernels " + before + " and goes on with " + now +
               (before == "cuda" ? "; --device cuda" : "; --device cpu --set kernels=" + before) +
               " goes on as it began");
}

void save_times(const std::filesystem::path& snapshot, const SnapshotTimes& times) {
  write_file(times_file(snapshot), nlohmann::json(times).dump(2) + "\n");
}

SnapshotTimes load_times(const std::filesystem::path& snapshot) {
  try {
    return read_json<InputError, nlohmann::json>(times_file(snapshot)).get<SnapshotTimes>();
  } catch (const Error&) {
    return {};
  } catch (const nlohmann::json::exception&) {
    return {};
  }
}

}  // namespace cnerf
