#pragma once
/// Strict binding between TOML and fields: no key, type or value passes silently.

#include <string>
#include <string_view>
#include <vector>

#include "src/config/fields.h"

namespace cnerf {

/// A key that options used to have.
struct RetiredKey {
  std::string key;
  std::string now;      ///< the key that has its meaning; empty = none has
  std::string was;      ///< its default as TOML, with which it says nothing; empty = it always said something
  std::string instead;  ///< where `now` is empty: what to do without it
};

/// What to do with retired keys: people are told; but what the program wrote itself, before a key was retired, holds
/// every key. There it is left out, with a note where it says something that no successor says.
enum class Retired { kRefused, kLeftOut };

/// Reads `text` over `fields`: keys that are absent keep their value.
/// @param source  what errors call the text: a file name.
/// @throws UsageError  broken TOML, an unknown key (names the nearest known one), a retired one (and its successor), a
///                     wrong type, a value out of range; the message reads `source: key: what was expected, what was
///                     found`. Fields read before the faulty one keep their new values.
/// @return  notes on retired keys that were left out
std::vector<std::string> read_toml(std::string_view text, const std::string& source, const std::vector<Field>& fields,
                                   const std::vector<RetiredKey>& retired = {}, Retired treatment = Retired::kRefused);

/// Applies one `key.path=value` of the command line. Strings need no quotes; lists are TOML arrays or comma-separated.
/// @throws UsageError  as `read_toml`.
void apply_setting(std::string_view setting, const std::vector<Field>& fields,
                   const std::vector<RetiredKey>& retired = {});

/// All fields as TOML that `read_toml` reads back to equal values, bit for bit.
[[nodiscard]] std::string write_toml(const std::vector<Field>& fields);

/// The candidate with the smallest edit distance (insertions, deletions, substitutions) to `word`; empty when none is
/// closer than half of the word's length, or two for short words.
[[nodiscard]] std::string nearest_name(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace cnerf
