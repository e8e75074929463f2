#pragma once
/// A palette: words for colours. Hints and strokes that name a word have its colour, and change with it.

#include <map>
#include <optional>
#include <set>
#include <string>

namespace cnerf::pipeline {

class Palette {
 public:
  Palette() = default;
  /// Of "jacket=#8a2be2,wall=#c0c0b0"; a `;` separates as a comma does. No word begins with `#`, as colours do.
  /// @throws UsageError  naming the entry: no word, no colour, or a word that has one already
  explicit Palette(const std::string& text);

  /// The colour of a word, "#rrggbb". From now on somebody names that word.
  [[nodiscard]] std::optional<std::string> find(const std::string& word);
  /// For messages: "jacket, wall"; "none" where the palette is empty.
  [[nodiscard]] std::string words() const;
  /// A word that nobody named is a mistake, of it or of a hint.
  /// @throws UsageError  naming the word
  void refuse_unnamed() const;

 private:
  std::map<std::string, std::string> colors_;
  std::set<std::string> named_;
};

}  // namespace cnerf::pipeline
