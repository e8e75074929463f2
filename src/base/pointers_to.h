#pragma once
/// Words as exec and posix_spawn want them.

#include <string>
#include <vector>

namespace cnerf {

/// @returns pointers into `words`, and a null pointer behind them
[[nodiscard]] inline std::vector<char*> pointers_to(std::vector<std::string>& words) {
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace cnerf
