#include "src/base/gzip.h"

#include <gtest/gtest.h>
#include <zlib.h>

namespace cnerf {
namespace {

std::vector<std::uint8_t> some_bytes() {
  std::vector<std::uint8_t> bytes(700'000);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = std::uint8_t(i * i >> 3);
  return bytes;
}
constexpr std::size_t kMost = 1 << 24;

/// By the library itself, in one call.
std::vector<std::uint8_t> inflated(const std::vector<std::byte>& packed) {
  z_stream stream{};
  EXPECT_EQ(inflateInit2(&stream, 15 + 16), Z_OK);
  std::vector<std::uint8_t> result(kMost);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = result.data();
  stream.avail_out = static_cast<uInt>(result.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  result.resize(stream.total_out);
  inflateEnd(&stream);
  return result;
}

TEST(Gzip, ComesBackAndIsTheSameEveryTime) {
  const std::vector<std::uint8_t> bytes = some_bytes();
  EXPECT_EQ(inflated(gzip(bytes)), bytes);
  EXPECT_EQ(gunzip(gzip(bytes), kMost), bytes);
  EXPECT_EQ(gzip(bytes), gzip(bytes));
  EXPECT_TRUE(inflated(gzip({})).empty());
  EXPECT_EQ(gunzip(gzip({}), 0), std::vector<std::uint8_t>());
}

TEST(Gzip, DamageAndTooMuchAreNoticed) {
  const std::vector<std::uint8_t> bytes = some_bytes();
  const std::vector<std::byte> good = gzip(bytes);
  EXPECT_TRUE(gunzip(good, bytes.size()));
  EXPECT_FALSE(gunzip(good, bytes.size() - 1));
  for (const std::size_t place : {std::size_t(0), good.size() / 2, good.size() - 6}) {
    std::vector<std::byte> bad = good;
    bad[place] ^= std::byte{1};
    EXPECT_FALSE(gunzip(bad, kMost)) << "byte " << place;
  }
  EXPECT_FALSE(gunzip(std::span(good).first(good.size() - 1), kMost));
  EXPECT_FALSE(gunzip({}, kMost));
}

}  // namespace
}  // namespace cnerf
