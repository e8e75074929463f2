#include "tests/mutants/envelope.h"

#include <zlib.h>

#include <cstdint>
#include <cstring>
#include <span>

#include "bake/out_of_core/journal_checksum.h"
#include "src/base/files.h"
#include "src/base/gzip.h"

namespace cnerf::mutants {
namespace {

constexpr std::size_t kDigest = 64;

template <typename T>
T value_at(const std::string& bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

template <typename T>
void append(std::string& to, T value) {
  to.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

std::string digest_of(const std::string& bytes) {
  return sha256(bytes_of(bytes));
}

// ---- snapshots: magic, version, size of the header, header, pieces, digest ------------------------------------------

std::optional<Envelope> opened_snapshot(const std::string& file) {
  constexpr std::size_t kSize = 12, kHeader = 20;
  if (file.size() < kHeader + kDigest) return std::nullopt;
  const auto header = std::size_t(value_at<std::uint64_t>(file, kSize));
  if (header > file.size() - kHeader - kDigest) return std::nullopt;
  const std::string begin = file.substr(0, kSize);
  Envelope envelope;
  envelope.sections = {{file.substr(kHeader, header), true},
                       {file.substr(kHeader + header, file.size() - kHeader - header - kDigest), false}};
  envelope.seal = [begin](const std::vector<Section>& sections) {
    std::string sealed = begin;
    append(sealed, std::uint64_t(sections[0].bytes.size()));
    sealed += sections[0].bytes + sections[1].bytes;
    return sealed + digest_of(sealed);
  };
  return envelope;
}

// ---- weights: magic, digest of the content, gzip of the content with its even bytes first ---------------------------

std::string interleaved(const std::vector<std::uint8_t>& sorted) {
  std::string content(sorted.size(), '\0');
  const std::size_t evens = (sorted.size() + 1) / 2;
  for (std::size_t i = 0; i < sorted.size(); ++i) content[i] = char(sorted[i / 2 + (i % 2 == 0 ? 0 : evens)]);
  return content;
}

std::string evens_then_odds(const std::string& content) {
  std::string sorted;
  for (std::size_t first : {0, 1}) {
    for (std::size_t i = first; i < content.size(); i += 2) sorted += content[i];
  }
  return sorted;
}

/// gzip that only stores: campaigns pack often.
std::string stored(std::string bytes) {
  z_stream stream{};
  constexpr int kGzip = 15 + 16;
  if (::deflateInit2(&stream, Z_NO_COMPRESSION, Z_DEFLATED, kGzip, 8, Z_DEFAULT_STRATEGY) != Z_OK) return {};
  std::string packed(::deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(bytes.data());
  stream.avail_in = uInt(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = uInt(packed.size());
  (void)::deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  ::deflateEnd(&stream);
  return packed;
}

std::optional<Envelope> opened_weights(const std::string& file) {
  constexpr std::size_t kMagic = 8, kMost = std::size_t(1) << 26;
  if (file.size() < kMagic + kDigest) return std::nullopt;
  const auto unpacked = gunzip(std::as_bytes(std::span(file)).subspan(kMagic + kDigest), kMost);
  if (!unpacked) return std::nullopt;
  const std::string magic = file.substr(0, kMagic), content = interleaved(*unpacked);
  // What is interesting lies in front; most of the file is weights.
  constexpr std::size_t kFront = 4096;
  Envelope envelope;
  envelope.sections = {{content.substr(0, kFront), false}, {content.substr(std::min(kFront, content.size())), false}};
  envelope.seal = [magic](const std::vector<Section>& sections) {
    const std::string whole = sections[0].bytes + sections[1].bytes;
    return magic + digest_of(whole) + stored(evens_then_odds(whole));
  };
  return envelope;
}

// ---- journals: size, checksum and bytes of each part; the first is the bake's identity ------------------------------

std::optional<Envelope> opened_journal(const std::string& file) {
  constexpr std::size_t kHeader = 16;
  Envelope envelope;
  for (std::size_t at = 0; at < file.size();) {
    if (file.size() - at < kHeader) return std::nullopt;
    const auto size = std::size_t(value_at<std::uint64_t>(file, at));
    at += kHeader;
    if (size > file.size() - at) return std::nullopt;
    envelope.sections.push_back({file.substr(at, size), false});
    at += size;
  }
  if (envelope.sections.empty()) return std::nullopt;
  envelope.seal = [](const std::vector<Section>& sections) {
    const std::string& identity = sections[0].bytes;
    std::string sealed;
    for (std::size_t i = 0; i < sections.size(); ++i) {
      const std::size_t number = i == 0 ? 0 : i - 1;  // the identity is not counted
      append(sealed, std::uint64_t(sections[i].bytes.size()));
      append(sealed, bake::part_checksum(bytes_of(identity), number, bytes_of(sections[i].bytes)));
      sealed += sections[i].bytes;
    }
    return sealed;
  };
  return envelope;
}

}  // namespace

std::optional<Envelope> opened(Format format, const std::string& file) {
  switch (format) {
    case Format::kSnapshot:
      return opened_snapshot(file);
    case Format::kWeights:
      return opened_weights(file);
    case Format::kJournal:
      return opened_journal(file);
    case Format::kPlain:
      break;
  }
  return std::nullopt;
}

}  // namespace cnerf::mutants
