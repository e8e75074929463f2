#pragma once
/// A picture most pixels of which need not be traced, because those around them tell what they look like.
///
/// Pixels come in passes, from a coarse lattice to all of them. A pass's pixels lie in the middle of four that are
/// known by then: where these agree, they foretell the pixel, and elsewhere it is traced. Colours are coarser: they are
/// known at every second pixel of every second row, and spread from there to pixels of like lightness, so that they do
/// not run across edges that lightness shows.

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "src/color/ab_bins.h"
#include "src/color/colorspace_math.h"

namespace cnerf::studio {

class SparsePixels {
 public:
  /// @param lattice  side of the squares whose corners and middles are traced in any case: a power of two; 1 = every
  ///                 pixel is, and has colours
  /// @param sides    of colours that a pixel has
  SparsePixels(int width, int height, int lattice, std::size_t sides);

  [[nodiscard]] std::size_t passes() const { return passes_.size(); }
  /// Whether the pixels that are traced in a pass need colours.
  [[nodiscard]] bool needs_colors(std::size_t pass) const { return !colors_.empty() && passes_[pass].has_colors; }
  /// Foretells what it can of a pass. To be called once for each pass in order, and its pixels to be set.
  /// @return  the pixels that are to be traced, y * width + x, ascending
  [[nodiscard]] std::vector<std::size_t> foretell(std::size_t pass);
  /// @param luminance  [P] linear Y of the pixels
  void set_light(std::span<const std::size_t> pixels, std::span<const float> luminance);
  /// @param colors  [P] of the pixels
  void set_colors(std::size_t side, std::span<const std::size_t> pixels, std::span<const Ab> colors);
  /// After all passes: gives the pixels that have none a colour.
  void spread_colors();

  /// L*, [H, W].
  [[nodiscard]] std::span<const float> lightness() const { return lightness_.values(); }
  /// a and b of a side, [H, W] each.
  [[nodiscard]] std::array<std::span<const float>, 2> colors(std::size_t side) const {
    return {colors_[side][0].values(), colors_[side][1].values()};
  }

 private:
  /// Pixels whose neighbours lie at a distance of `reach` along both axes: columns and rows, or diagonals.
  struct Pass {
    int reach = 0;  ///< 0: the lattice itself, with no neighbours
    bool is_diagonal = false;
    bool has_colors = true;
  };
  /// [H, W]. Nothing is written before it is known: to touch all of the memory once more takes longer than a pass.
  class Plane {
   public:
    explicit Plane(std::size_t size) : size_(size), values_(std::make_unique_for_overwrite<float[]>(size)) {}
    [[nodiscard]] float* at(std::size_t pixel) { return &values_[pixel]; }
    [[nodiscard]] std::span<const float> values() const { return {values_.get(), size_}; }

   private:
    std::size_t size_;
    std::unique_ptr<float[]> values_;
  };
  using Colors = std::array<Plane, 2>;
  /// Columns of a row that belong to a pass: first, first + step, ...
  struct Columns {
    int first = 0, step = 1;
  };
  [[nodiscard]] Columns columns_of(const Pass& pass, int row) const;
  /// @return  whether the pixel is known by now
  bool foretell_pixel(const Pass& pass, int column, int row);
  /// @param axes  from the pixel to a neighbour, as indices differ
  bool foretell_colors(std::size_t pixel, const std::array<std::ptrdiff_t, 2>& axes);
  void spread_to(int column, int row);

  int width_, height_, lattice_;
  std::vector<Pass> passes_;
  Plane lightness_;
  std::vector<Colors> colors_;  // [sides] a and b
};

}  // namespace cnerf::studio
