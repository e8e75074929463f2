#pragma once
/// JSON that others wrote: files of any content are read without harm, and quoted in messages without flooding them.

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/text.h"

namespace cnerf {

/// Lists and objects may nest this deep. What walks or copies a value recurses, so that a few hundred kilobytes of
/// brackets would overflow the stack.
inline constexpr int kDeepestJson = 64;

/// A text as JSON; comments are allowed.
/// @param file  that errors name
/// @throws Problem  where it is no JSON, or nests deeper than kDeepestJson; any type that is made of a message
template <typename Problem = InputError, typename Json = nlohmann::ordered_json>
[[nodiscard]] Json parse_json(std::string_view text, const std::filesystem::path& file) {
  bool too_deep = false;
  // What lies deeper is not kept, so that nothing ever recurses into it.
  const auto is_kept = [&](int depth, typename Json::parse_event_t, Json&) {
    too_deep = too_deep || depth > kDeepestJson;
    return depth <= kDeepestJson;
  };
  try {
    Json json = Json::parse(text, is_kept, /*allow_exceptions=*/true, /*ignore_comments=*/true);
    if (!too_deep) return json;
  } catch (const nlohmann::json::exception& failure) {
    constexpr std::size_t kLongest = 400;  // it quotes what it read last, however long
    throw Problem(file.string() + ": expected JSON, found " + shortened(failure.what(), kLongest));
  }
  throw Problem(file.string() + ": expected JSON of at most " + std::to_string(kDeepestJson) +
                " levels, found deeper lists or objects");
}

/// The same of a file.  @throws MissingInputError, InputError, and Problem as `parse_json`.
template <typename Problem = InputError, typename Json = nlohmann::ordered_json>
[[nodiscard]] Json read_json(const std::filesystem::path& file) {
  std::error_code failure;
  if (std::filesystem::exists(file, failure) && !std::filesystem::is_regular_file(file, failure)) {
    throw InputError(file, "", "expected a file, found a folder, pipe or device");  // a pipe might never end
  }
  return parse_json<Problem, Json>(read_text_file(file), file);
}

/// Whether a T can be what a JSON value is: a number is no truth value, 1.5 no count, and none may be too large for T.
template <typename T, typename Json>
[[nodiscard]] bool holds(const Json& json) {
  if constexpr (std::is_same_v<T, bool>) {
    return json.is_boolean();
  } else if constexpr (std::is_integral_v<T>) {
    if (json.is_number_unsigned()) return std::in_range<T>(json.template get<std::uint64_t>());
    return json.is_number_integer() && std::in_range<T>(json.template get<std::int64_t>());
  } else if constexpr (std::is_floating_point_v<T>) {
    return json.is_number() && std::abs(json.template get<double>()) <= double(std::numeric_limits<T>::max());
  } else {
    return true;
  }
}

/// A value as a message quotes it: its beginning where it is long.
template <typename Json>
[[nodiscard]] std::string excerpt(const Json& value) {
  constexpr std::size_t kLongest = 120;
  return shortened(value.dump(-1, ' ', /*ensure_ascii=*/false, Json::error_handler_t::replace), kLongest);
}

/// Reads a value, which `get` would also make of a fraction, or of a number that the type does not hold.
/// @throws nlohmann::json::exception
template <typename Json, typename T>
void read_exactly(const Json& json, T& value) {
  if (!holds<T>(json)) throw Json::type_error::create(302, "not such a number: " + excerpt(json), &json);
  json.get_to(value);
}

}  // namespace cnerf
