#include "src/pipeline/palette.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "src/base/error.h"
#include "src/base/text.h"
#include "src/train/chroma/strokes.h"

namespace cnerf::pipeline {

Palette::Palette(const std::string& text) {
  std::string list = text;
  std::ranges::replace(list, ';', ',');
  for (const std::string& entry : split(list, ',')) {
    const std::string where = "--palette " + entry;
    const std::vector<std::string> parts = split(entry, '=');
    if (parts.size() != 2 || parts[0].starts_with('#')) throw UsageError(where + ": expected WORD=#rrggbb");
    const auto& [word, color] = std::pair(parts[0], parts[1]);
    if (!ab_of_hex(color)) throw UsageError(where + ": expected a colour like #c08040, found " + color);
    if (!colors_.emplace(word, color).second) throw UsageError(where + ": " + word + " has a colour already");
  }
}

std::optional<std::string> Palette::find(const std::string& word) {
  const auto found = colors_.find(word);
  if (found == colors_.end()) return {};
  named_.insert(word);
  return found->second;
}

std::string Palette::words() const {
  std::vector<std::string> words;
  for (const auto& [word, color] : colors_) words.push_back(word);
  return words.empty() ? "none" : joined(words, ", ");
}

void Palette::refuse_unnamed() const {
  for (const auto& [word, color] : colors_) {
    if (named_.contains(word)) continue;
    throw UsageError("--palette " + word + "=" + color + ": no hint and no stroke is called " + word +
                     "; a hint is x,y,VIEW," + word);
  }
}

}  // namespace cnerf::pipeline
