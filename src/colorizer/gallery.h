#pragma once
/// Contact sheets of coloured patches, for eyes: base candidates, accepted and rejected answers.

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace cnerf {

struct GalleryTile {
  int height = 0, width = 0;
  std::vector<float> lightness;  ///< [H, W] L* 0..100
  std::vector<float> ab;         ///< [2, H, W]; empty = grey
  std::string caption;           ///< one line below the tile; ASCII, cut where it does not fit; may be empty
};

/// Writes the tiles row by row as an 8-bit sRGB PNG, with thin margins, and a row of captions if any tile has one.
/// Tiles of different sizes are padded to the largest. No tiles give a sheet with one empty cell.
/// @throws OutputError    when the file cannot be written.
/// @throws ContractError  when a tile's size and values disagree.
void write_gallery(const std::filesystem::path& file, std::span<const GalleryTile> tiles, int columns = 5);

}  // namespace cnerf
