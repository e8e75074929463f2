#include "tests/mutants/mutate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <vector>

namespace cnerf::mutants {
namespace {

using Change = Mutant (*)(const std::string&, Random&);

/// A stretch of a file.
struct Block {
  std::size_t begin = 0, size = 0;
};

Block some_block(const std::string& text, Random& random) {
  const std::size_t begin = random.below(text.size());
  const std::size_t longest = random.chance(4) ? text.size() : 64;
  return {begin, 1 + random.below(std::min(longest, text.size() - begin))};
}

template <typename T>
std::string native_bytes(T value) {
  return {reinterpret_cast<const char*>(&value), sizeof value};
}

// ---- of any file ----------------------------------------------------------------------------------------------------

Mutant with_flipped_bits(const std::string& original, Random& random) {
  Mutant mutant{original, "bits:"};
  for (std::size_t n = 1 + random.below(3); n > 0; --n) {
    const std::size_t at = random.below(original.size()), bit = random.below(8);
    mutant.bytes[at] = char(std::uint8_t(mutant.bytes[at]) ^ (1U << bit));
    mutant.change += fmt::format(" {} of byte {}", bit, at);
  }
  return mutant;
}

Mutant with_other_bytes(const std::string& original, Random& random) {
  Mutant mutant{original, "bytes:"};
  for (std::size_t n = 1 + random.below(4); n > 0; --n) {
    const std::size_t at = random.below(original.size());
    mutant.bytes[at] = random.chance(2) ? random.byte()
                                        : random.of(
                                              "\0\xFF\x7F\x80"
                                              "09-\"");
    mutant.change += fmt::format(" {} is {}", at, int(std::uint8_t(mutant.bytes[at])));
  }
  return mutant;
}

Mutant with_extreme_number(const std::string& original, Random& random) {
  static const std::vector<std::string> numbers = {native_bytes(std::uint32_t(0)),
                                                   native_bytes(std::uint32_t(1)),
                                                   native_bytes(~std::uint32_t(0)),
                                                   native_bytes(std::uint32_t(1) << 31),
                                                   native_bytes(~std::uint32_t(0) / 2),
                                                   native_bytes(std::uint64_t(0)),
                                                   native_bytes(~std::uint64_t(0)),
                                                   native_bytes(std::uint64_t(1) << 63),
                                                   native_bytes(std::uint64_t(1) << 40),
                                                   native_bytes(std::uint64_t(1) << 32),
                                                   native_bytes(std::uint16_t(0xFFFF)),
                                                   native_bytes(1e308),
                                                   native_bytes(-1.0),
                                                   native_bytes(1e-308),
                                                   native_bytes(std::numeric_limits<double>::quiet_NaN()),
                                                   native_bytes(std::numeric_limits<double>::infinity()),
                                                   native_bytes(1e30F),
                                                   native_bytes(std::numeric_limits<float>::quiet_NaN()),
                                                   native_bytes(-std::numeric_limits<float>::infinity())};
  const std::size_t which = random.below(numbers.size());
  const std::string& number = numbers[which];
  const std::size_t align = random.chance(2) ? number.size() : 1;
  const std::size_t at = random.below(original.size()) / align * align;
  Mutant mutant{original, fmt::format("extreme number {} at byte {}", which, at)};
  mutant.bytes.replace(at, std::min(number.size(), original.size() - at), number);
  return mutant;
}

Mutant cut(const std::string& original, Random& random) {
  const std::size_t left = random.chance(4)
                               ? original.size() - std::min<std::size_t>(original.size(), 1 + random.below(8))
                               : random.below(original.size());
  return {original.substr(0, left), fmt::format("cut to {} of {} bytes", left, original.size())};
}

Mutant with_inserted_block(const std::string& original, Random& random) {
  const std::size_t at = random.below(original.size() + 1), size = 1 + random.below(random.chance(8) ? 100'000 : 64);
  const bool is_noise = random.chance(2);
  const char one = random.byte();
  std::string block;
  for (std::size_t i = 0; i < size; ++i) block += is_noise ? random.byte() : one;
  Mutant mutant{original, fmt::format("{} bytes inserted at {}", size, at)};
  mutant.bytes.insert(at, block);
  return mutant;
}

Mutant with_doubled_block(const std::string& original, Random& random) {
  const Block block = some_block(original, random);
  Mutant mutant{original, fmt::format("{} bytes at {} doubled", block.size, block.begin)};
  mutant.bytes.insert(block.begin, original.substr(block.begin, block.size));
  return mutant;
}

Mutant without_block(const std::string& original, Random& random) {
  const Block block = some_block(original, random);
  Mutant mutant{original, fmt::format("{} bytes at {} removed", block.size, block.begin)};
  mutant.bytes.erase(block.begin, block.size);
  return mutant;
}

Mutant with_swapped_blocks(const std::string& original, Random& random) {
  const std::size_t size = std::size_t(4) << random.below(4);
  if (original.size() < 2 * size) return with_flipped_bits(original, random);
  const std::size_t a = random.below(original.size() - size), b = random.below(original.size() - size);
  Mutant mutant{original, fmt::format("{} bytes at {} and {} swapped", size, a, b)};
  mutant.bytes.replace(a, size, original, b, size);
  mutant.bytes.replace(b, size, original, a, size);
  return mutant;
}

// ---- of text --------------------------------------------------------------------------------------------------------

/// Numbers and quoted words.
std::vector<Block> values_of(const std::string& text) {
  constexpr std::string_view kOfNumbers = "+-.0123456789eE";
  std::vector<Block> values;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t begin = at;
    const auto is_digit = [&](std::size_t i) { return i < text.size() && std::isdigit(std::uint8_t(text[i])) != 0; };
    const bool in_word = at > 0 && (std::isalnum(std::uint8_t(text[at - 1])) != 0 || text[at - 1] == '_');
    if (text[at] == '"') {
      for (++at; at < text.size() && text[at] != '"' && text[at] != '\n'; ++at) at += text[at] == '\\' ? 1 : 0;
      at = std::min(at + 1, text.size());
      values.push_back({begin, at - begin});
    } else if (!in_word && (is_digit(at) || (text[at] == '-' && is_digit(at + 1)))) {
      while (at < text.size() && kOfNumbers.find(text[at]) != kOfNumbers.npos) ++at;
      values.push_back({begin, at - begin});
    } else {
      ++at;
    }
  }
  return values;
}

std::string excerpt(const std::string& text) {
  return text.size() > 40 ? fmt::format("{}... ({} characters)", text.substr(0, 40), text.size()) : text;
}

Mutant with_value(const std::string& original, Block place, const std::string& value) {
  Mutant mutant{original, fmt::format("'{}' at {} is now '{}'", excerpt(original.substr(place.begin, place.size)),
                                      place.begin, excerpt(value))};
  mutant.bytes.replace(place.begin, place.size, value);
  return mutant;
}

bool is_word(const std::string& text, Block value) {
  return text[value.begin] == '"';
}

Mutant with_extreme_value(const std::string& original, Random& random) {
  static const std::vector<std::string> numbers = {"0",
                                                   "-1",
                                                   "1",
                                                   "1e308",
                                                   "-1e308",
                                                   "1e-308",
                                                   "nan",
                                                   "NaN",
                                                   "inf",
                                                   "-inf",
                                                   "2147483647",
                                                   "2147483648",
                                                   "-2147483649",
                                                   "4294967296",
                                                   "9223372036854775807",
                                                   "9223372036854775808",
                                                   "18446744073709551616",
                                                   "1e400",
                                                   "0.5",
                                                   "99999999999999999999999",
                                                   "1e9",
                                                   "32768",
                                                   "65536"};
  static const std::vector<std::string> words = {
      "\"\"",          "\".\"",         "\"..\"",       "\"/\"",        "\"../../../etc/passwd\"",
      "\"/dev/zero\"", "\"a\\u0000b\"", "\"\\ud800\"",  "\"\xC3\xA9\"", "\"%s%n\"",
      "\" \"",         "\"\\n\"",       "\"nonsense\"", "\"-1\""};
  const std::vector<Block> values = values_of(original);
  if (values.empty()) return mutate_bytes(original, random);
  const Block place = random.of(values);
  return with_value(original, place, random.of(is_word(original, place) ? words : numbers));
}

Mutant with_long_word(const std::string& original, Random& random) {
  static const std::vector<std::size_t> sizes = {256, 300, 5000, 70'000, 1'000'000};
  const std::vector<Block> values = values_of(original);
  if (values.empty()) return mutate_bytes(original, random);
  const std::string letters(random.of(sizes), random.of("a9/."));
  const Block place = random.of(values);
  return with_value(original, place, random.chance(4) ? letters : "\"" + letters + "\"");
}

Mutant with_depth(const std::string& original, Random& random) {
  static const std::vector<std::size_t> depths = {70, 1000, 30'000, 200'000};
  const std::vector<Block> values = values_of(original);
  if (values.empty()) return mutate_bytes(original, random);
  const std::size_t depth = random.of(depths);
  std::string open(depth, '['), close(depth, ']');
  if (random.chance(3)) {
    open.clear();
    for (std::size_t i = 0; i < depth; ++i) open += "{\"a\":";
    open += "1";
    close.assign(depth, '}');
  }
  return with_value(original, random.of(values), open + (random.chance(3) ? "" : close));
}

Mutant with_other_type(const std::string& original, Random& random) {
  static const std::vector<std::string> others = {"null", "true",      "[]", "{}",        "\"word\"",
                                                  "3",    "[1, 2, 3]", "",   "{\"a\": 1}"};
  const std::vector<Block> values = values_of(original);
  if (values.empty()) return mutate_bytes(original, random);
  return with_value(original, random.of(values), random.of(others));
}

Mutant with_swapped_values(const std::string& original, Random& random) {
  const std::vector<Block> values = values_of(original);
  if (values.size() < 2) return mutate_bytes(original, random);
  std::size_t i = random.below(values.size()), j = random.below(values.size() - 1);
  j += j >= i ? 1 : 0;
  const auto [first, second] = std::minmax(i, j);
  const Block a = values[first], b = values[second];
  const std::string text_a = original.substr(a.begin, a.size), text_b = original.substr(b.begin, b.size);
  Mutant mutant{original,
                fmt::format("'{}' at {} and '{}' at {} swapped", excerpt(text_a), a.begin, excerpt(text_b), b.begin)};
  mutant.bytes.replace(b.begin, b.size, text_a);
  mutant.bytes.replace(a.begin, a.size, text_b);
  return mutant;
}

/// Lines, or what stands between commas.
Mutant with_pieces_changed(const std::string& original, Random& random) {
  const char end = original.find('\n') != std::string::npos && !random.chance(3) ? '\n' : ',';
  std::vector<Block> pieces;
  for (std::size_t at = 0; at < original.size();) {
    const std::size_t next = std::min(original.find(end, at), original.size() - 1) + 1;
    pieces.push_back({at, next - at});
    at = next;
  }
  const Block piece = random.of(pieces);
  const bool doubled = random.chance(3);
  Mutant mutant{original, fmt::format("'{}' at {} {}", excerpt(original.substr(piece.begin, piece.size)), piece.begin,
                                      doubled ? "doubled" : "removed")};
  if (doubled) {
    mutant.bytes.insert(piece.begin, original.substr(piece.begin, piece.size));
  } else {
    mutant.bytes.erase(piece.begin, piece.size);
  }
  return mutant;
}

}  // namespace

Mutant mutate_bytes(const std::string& original, Random& random) {
  static const std::vector<Change> changes = {
      with_flipped_bits,   with_flipped_bits,  with_other_bytes, with_extreme_number, with_extreme_number, cut,
      with_inserted_block, with_doubled_block, without_block,    with_swapped_blocks};
  if (original.empty()) return with_inserted_block(original, random);
  return random.of(changes)(original, random);
}

Mutant mutate_text(const std::string& original, Random& random) {
  static const std::vector<Change> changes = {
      with_extreme_value, with_extreme_value, with_extreme_value,  with_extreme_value,  with_long_word,
      with_depth,         with_other_type,    with_swapped_values, with_pieces_changed, mutate_bytes};
  if (original.empty()) return with_inserted_block(original, random);
  return random.of(changes)(original, random);
}

}  // namespace cnerf::mutants
