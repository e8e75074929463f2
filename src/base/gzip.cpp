#include "src/base/gzip.h"

#include <zlib.h>

#include <algorithm>
#include <limits>

#include "src/base/check.h"

namespace cnerf {
namespace {

constexpr int kGzip = 15 + 16;              // window of 32 KiB; 16 asks for a gzip header instead of zlib's
constexpr std::size_t kLargest = 1u << 30;  // zlib counts in 32 bits: larger inputs go in pieces
constexpr std::size_t kBlock = 1u << 18;

}  // namespace

std::vector<std::byte> gzip(std::span<const std::uint8_t> bytes) {
  z_stream stream{};
  CNERF_CHECK(deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, kGzip, 9, Z_FILTERED) == Z_OK, "zlib cannot start");
  std::vector<std::byte> packed;
  std::vector<std::byte> block(kBlock);
  std::size_t at = 0;
  int state = Z_OK;
  while (state != Z_STREAM_END) {
    if (stream.avail_in == 0) {
      const std::size_t count = std::min(kLargest, bytes.size() - at);
      stream.next_in = const_cast<Bytef*>(bytes.data() + at);
      stream.avail_in = static_cast<uInt>(count);
      at += count;
    }
    stream.next_out = reinterpret_cast<Bytef*>(block.data());
    stream.avail_out = static_cast<uInt>(block.size());
    state = deflate(&stream, at == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
    if (state != Z_OK && state != Z_STREAM_END) {
      deflateEnd(&stream);
      CNERF_CHECK(false, "zlib failed");
    }
    packed.insert(packed.end(), block.begin(), block.begin() + std::ptrdiff_t(block.size() - stream.avail_out));
  }
  deflateEnd(&stream);
  return packed;
}

std::optional<std::vector<std::uint8_t>> gunzip(std::span<const std::byte> packed, std::size_t most) {
  z_stream stream{};
  CNERF_CHECK(inflateInit2(&stream, kGzip) == Z_OK, "zlib cannot start");
  std::vector<std::uint8_t> bytes;
  std::size_t at = 0;
  int state = Z_OK;
  while (state == Z_OK && bytes.size() <= most) {
    if (stream.avail_in == 0) {
      const std::size_t count = std::min(kLargest, packed.size() - at);
      stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(packed.data() + at));
      stream.avail_in = static_cast<uInt>(count);
      at += count;
    }
    const std::size_t before = bytes.size();
    bytes.resize(before + kBlock);
    stream.next_out = bytes.data() + before;
    stream.avail_out = static_cast<uInt>(kBlock);
    state = inflate(&stream, Z_NO_FLUSH);
    bytes.resize(bytes.size() - stream.avail_out);
  }
  inflateEnd(&stream);
  if (state != Z_STREAM_END || bytes.size() > most) return std::nullopt;
  return bytes;
}

}  // namespace cnerf
