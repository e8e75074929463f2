#pragma once
/// Numbers and lists formatted for people.

#include <string>
#include <vector>

namespace cnerf {

/// The words with a separator between them.
[[nodiscard]] inline std::string joined(const std::vector<std::string>& words, const std::string& separator = " ") {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : separator) + word;
  return text;
}

/// "1 h 02 min", "3 min 20 s", "12 s".
[[nodiscard]] std::string duration_text(double seconds);

}  // namespace cnerf
