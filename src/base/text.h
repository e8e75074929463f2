#pragma once
/// Texts put together.

#include <string>
#include <vector>

namespace cnerf {

/// The words with a separator between them.
[[nodiscard]] inline std::string joined(const std::vector<std::string>& words, const std::string& separator = " ") {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : separator) + word;
  return text;
}

}  // namespace cnerf
