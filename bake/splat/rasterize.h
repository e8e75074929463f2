#pragma once
/// Pictures of splats on the processor, and the gradient of a loss by their parameters. The same results for any number
/// of threads.

#include <cstdint>
#include <span>
#include <vector>

#include "bake/splat/splat_math.h"

namespace cnerf::bake {

/// Over black. sRGB-encoded; premultiplied, as viewers blend encoded colours.
struct SplatPicture {
  int width = 0, height = 0;
  std::vector<float> rgb;      ///< [H, W, 3]
  std::vector<float> opacity;  ///< [H, W]
};

/// What a picture's pixels tell the splats in it.
struct SplatGradients {
  std::vector<std::uint32_t> splats;  ///< that are in the picture, nearest first
  std::vector<Splat> gradients;       ///< of each
  std::vector<float> weights;         ///< pixels of light that come from each
};

/// Draws splats sorted by the depth of their centres.
class SplatRasterizer {
 public:
  /// @return  valid until the next call.
  const SplatPicture& draw(std::span<const Splat> splats, const SplatCamera<float>& camera);
  /// Of the picture that was drawn last, with the same splats and camera.
  /// @param d  the loss by the picture's values.  @return  valid until the next call.
  const SplatGradients& gradient(std::span<const Splat> splats, const SplatCamera<float>& camera,
                                 const SplatPicture& d);

 private:
  /// A splat in the picture with the tiles it reaches.
  struct Placed {
    std::uint32_t splat;
    float depth;
    TileSplat flat;
    int left, top, right, bottom;  ///< tiles, both ends included
    std::uint32_t first_place;     ///< of its sums, which go by rows of tiles
    [[nodiscard]] std::uint32_t tiles() const { return std::uint32_t((right - left + 1) * (bottom - top + 1)); }
  };

  void place(std::span<const Splat> splats, const SplatCamera<float>& camera);
  void sort_by_depth();
  void list_tiles();
  [[nodiscard]] Splat splat_gradient(const Splat& splat, const SplatCamera<float>& camera, const Placed& placed,
                                     float& weight) const;

  int columns_ = 0, rows_ = 0;  // of tiles
  std::vector<Placed> unsorted_, placed_;
  std::vector<TileSplat> flats_;  // of placed_
  std::vector<std::uint32_t> list_ends_;
  std::vector<TileEntry> lists_;
  std::vector<TilePixels> tiles_;
  std::vector<TileSums> sums_;
  SplatPicture picture_;
  SplatGradients gradients_;
};

}  // namespace cnerf::bake
