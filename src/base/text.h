#pragma once
/// Numbers and lists formatted for people.

#include <string>
#include <string_view>
#include <vector>

namespace cnerf {

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
