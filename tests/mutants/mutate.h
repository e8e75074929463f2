#pragma once
/// Changes to the content of a file, from a flipped bit to a number nobody expects.

#include <string>

#include "tests/mutants/random.h"

namespace cnerf::mutants {

struct Mutant {
  std::string bytes;
  std::string change;  ///< what was changed, to be read by a person: "bit 3 of byte 1203"
};

/// Bits, bytes, extreme numbers, cuts, and blocks that are inserted, doubled, removed or swapped.
[[nodiscard]] Mutant mutate_bytes(const std::string& original, Random& random);

/// Of JSON, TOML and lists in text: values that are extreme, long, deep or of another type, swapped fields, lines that
/// are lost or doubled; at times also what `mutate_bytes` does.
[[nodiscard]] Mutant mutate_text(const std::string& original, Random& random);

}  // namespace cnerf::mutants
