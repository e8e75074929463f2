#pragma once
/// Numbers and lists formatted for people, and read from texts.

#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace cnerf {

/// The number that the whole text is; nothing where it is none.
template <typename Number>
[[nodiscard]] std::optional<Number> value_in(std::string_view text) {
  Number value{};
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  return failure == std::errc() && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

/// The words with a separator between them.
[[nodiscard]] inline std::string joined(const std::vector<std::string>& words, const std::string& separator = " ") {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : separator) + word;
  return text;
}

/// The parts of a list, without the spaces around them; empty ones are left out.
[[nodiscard]] std::vector<std::string> split(const std::string& text, char separator);

/// Whether a text is UTF-8, as the names in JSON, TOML, VDB and glTF files have to be.
[[nodiscard]] bool is_utf8(std::string_view text);

/// A text as a terminal may show it: control characters, which may come from anybody's file or
/// program, become `?`, and carriage returns ends of lines.
[[nodiscard]] std::string printable(std::string text);

/// A text of any length as a message quotes it: its beginning and "…" where it has more bytes than that.
[[nodiscard]] std::string shortened(std::string text, std::size_t longest);

/// "1 h 02 min", "3 min 20 s", "12 s".
[[nodiscard]] std::string duration_text(double seconds);

}  // namespace cnerf
