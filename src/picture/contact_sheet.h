#pragma once
/// Pictures of pictures: a grid of captioned tiles, and a table of titled columns.

#include <span>
#include <string>
#include <vector>

#include "src/picture/picture.h"

namespace cnerf {

inline constexpr std::uint8_t kSheetBackground = 32;  ///< of a grid of tiles: dark grey

struct Tile {
  Picture picture;      ///< without pixels: the cell stays empty
  std::string caption;  ///< one line below the picture; ASCII, cut where it does not fit; may be empty
};

/// The tiles row by row, with thin margins, and a line of captions below each row if any tile has one. Every cell is as
/// large as the largest picture. No tiles give a sheet with one empty cell.
[[nodiscard]] Picture tiled(std::span<const Tile> tiles, int columns = 5);

/// A table of pictures: one row per view, one column per kind, with a title above each column. Below it, side by side,
/// may stand what concerns all views.
class ContactSheet {
 public:
  /// @param cell_width  widest a cell gets, pixels; smaller pictures keep their size.
  explicit ContactSheet(std::vector<std::string> titles, int cell_width = 400);

  /// A row; a picture without pixels leaves its cell empty. The picture is scaled down here, so rows cost little.
  void add_row(const std::vector<Picture>& pictures);
  [[nodiscard]] int rows() const { return int(rows_.size()); }

  void add_below(Tile tile) { below_.push_back(std::move(tile)); }

  /// The sheet; columns that are empty in every row are left out.
  [[nodiscard]] Picture compose() const;

 private:
  std::vector<std::string> titles_;
  int cell_width_;
  std::vector<std::vector<Picture>> rows_;
  std::vector<Tile> below_;
};

}  // namespace cnerf
