#include "src/train/chroma/galleries.h"

#include "src/picture/encode.h"

namespace cnerf {
namespace {

constexpr std::size_t kMostTiles = 20;

}  // namespace

Tile tile_of(const AnsweredPatch& patch, std::string caption) {
  return {picture_from_linear(patch.side, patch.side, linear_rgb_from_lab(patch.shown.lightness, patch.ab)),
          std::move(caption)};
}

std::vector<Tile> candidate_tiles(std::span<const AnsweredPatch> patches) {
  std::vector<Tile> tiles;
  for (std::size_t i = 0; i < patches.size(); ++i) tiles.push_back(tile_of(patches[i], "base " + std::to_string(i)));
  return tiles;
}

void Galleries::remember(const AnsweredPatch& patch, bool is_accepted) {
  std::vector<Tile>& tiles = is_accepted ? accepted_ : rejected_;
  if (tiles.size() < kMostTiles) tiles.push_back(tile_of(patch, ""));
}

void Galleries::write(const std::filesystem::path& folder) const {
  write_png(folder / "accepted.png", tiled(accepted_));
  write_png(folder / "rejected.png", tiled(rejected_));
}

}  // namespace cnerf
