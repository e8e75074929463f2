#pragma once
/// Galleries of patches beside a take, for eyes: base candidates, accepted and rejected answers.

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "src/picture/contact_sheet.h"
#include "src/train/chroma/patches.h"

namespace cnerf {

[[nodiscard]] Tile tile_of(const AnsweredPatch& patch, std::string caption);
/// With captions "base 0", "base 1", …
[[nodiscard]] std::vector<Tile> candidate_tiles(std::span<const AnsweredPatch> patches);

/// The first answers that were accepted, and the first that were rejected.
class Galleries {
 public:
  void remember(const AnsweredPatch& patch, bool is_accepted);
  /// accepted.png and rejected.png
  void write(const std::filesystem::path& folder) const;

 private:
  std::vector<Tile> accepted_, rejected_;
};

}  // namespace cnerf
