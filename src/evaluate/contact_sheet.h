#pragma once
/// A picture of pictures: one row a view, one column a kind.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace cnerf {

/// 8-bit sRGB, [H, W, 3].
struct Picture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;
};

/// 8-bit sRGB of linear light: [H, W] luminance or [H, W, 3] RGB, told apart by size.
[[nodiscard]] Picture picture_from_linear(int width, int height, const std::vector<float>& linear);

/// Collects rows and writes them as one PNG with a title above each column.
class ContactSheet {
 public:
  /// @param cell_width  widest a cell gets, pixels; smaller pictures keep their size.
  explicit ContactSheet(std::vector<std::string> titles, int cell_width = 400);

  /// A row; a picture without pixels leaves its cell empty. The picture is scaled down here, so rows cost little.
  void add_row(const std::vector<Picture>& pictures);
  [[nodiscard]] int rows() const { return int(rows_.size()); }

  /// The sheet; columns that are empty in every row are left out.
  [[nodiscard]] Picture compose() const;

 private:
  std::vector<std::string> titles_;
  int cell_width_;
  std::vector<std::vector<Picture>> rows_;
};

/// The picture, scaled down to `width` where it is wider.
[[nodiscard]] Picture scaled_down(const Picture& picture, int width);
/// A JPEG file's bytes.  @param quality  0 to 100
[[nodiscard]] std::vector<std::byte> jpeg_bytes(const Picture& picture, int quality);

/// @throws OutputError.
void write_png(const std::filesystem::path& file, const Picture& picture);

}  // namespace cnerf
