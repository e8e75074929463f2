/// unfinished.bake: the file as it is, or its parts with their checksums. A part of the input is a number of 16 bits,
/// its size, and so many bytes.

#include "bake/out_of_core/journal.h"

#include <algorithm>
#include <cstdint>

#include "bake/out_of_core/journal_checksum.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

using cnerf::fuzz::Bytes;

constexpr std::string_view kIdentity = "the bake of a fuzz target";

void append_part(std::vector<std::byte>& file, std::size_t number, Bytes bytes) {
  cnerf::fuzz::append_value(file, std::uint64_t(bytes.size()));
  cnerf::fuzz::append_value(file, cnerf::bake::part_checksum(cnerf::fuzz::bytes_of(kIdentity), number, bytes));
  cnerf::fuzz::append_bytes(file, bytes);
}

std::size_t count_parts(Bytes input, std::vector<std::byte>& file) {
  append_part(file, 0, cnerf::fuzz::bytes_of(kIdentity));
  std::size_t parts = 0;
  for (std::uint16_t size = 0; input.size() >= sizeof size; ++parts) {
    std::memcpy(&size, input.data(), sizeof size);
    input = input.subspan(sizeof size);
    const Bytes part = input.first(std::min<std::size_t>(size, input.size()));
    append_part(file, parts, part);
    input = input.subspan(part.size());
  }
  return parts;
}

struct Record {
  std::uint32_t number;
  float value;
  std::uint32_t more;
};

}  // namespace

CNERF_FUZZ_TARGET(bake_journal) {
  using namespace cnerf;
  const bool has_parts = fuzz::take_byte(input) % 2 == 1;
  std::vector<std::byte> content;
  std::size_t parts = 0;
  if (has_parts) {
    parts = count_parts(input, content);
  } else {
    fuzz::append_bytes(content, input);
  }
  const auto file = fuzz::scratch_file("unfinished.bake", content);
  fuzz::read_or_refuse(file, [&] {
    bake::Journal journal(file, std::string(kIdentity));
    if (has_parts && journal.found() != parts) throw fuzz::Finding("a journal lost sound parts");
    const auto make = [](std::size_t) { return std::vector<Record>(2, Record{7, 1, 7}); };
    const auto use = [](std::size_t, const std::vector<Record>&) {};
    const auto is_sound = [](std::size_t, const std::vector<Record>& part) {
      return std::ranges::all_of(part, [](const Record& record) { return record.number == record.more; });
    };
    journal.parts<Record>(0, journal.found() + 2, 2, make, use, is_sound);
  });
}
