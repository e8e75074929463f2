#pragma once
/// Retouching: a take goes on with colours that somebody painted. Pixels that show what is painted learn its colours,
/// in every view; all others keep those of the take. No colorizer is asked, so it takes seconds.

#include <cstdint>
#include <span>

#include "src/train/chroma/color_model.h"
#include "src/train/chroma/known_color_map.h"

namespace cnerf {

struct RetouchOptions {
  int steps = 200;
  int known_pixels = 2048, kept_pixels = 3072;  ///< of a step
  double learning_rate = 2e-2, final_learning_rate = 2e-3;
  std::uint64_t seed = 1;
};

/// The soft label whose annealed mean is nearest to a colour. A usual one's is pulled to its bins' centres, by an ab
/// unit or two, which would add up as a take is retouched again and again.
[[nodiscard]] SoftLabel label_decoded_to(Ab color, float temperature);

class Retouch {
 public:
  /// All are referred to.
  /// @param base   the colours that stay where nothing is known; null: there are none, the scene is grey
  /// @param model  that learns; `base`'s state, or a later one
  Retouch(std::span<const CachedView> views, const KnownColorMap& known, const ColorModel* base, ColorModel& model,
          const RetouchOptions& options);

  /// One optimiser step of the pixels' distribution and one of the per-sample colour.  @return  the former's loss
  /// @throws DivergedError  when it is not finite
  double step();
  [[nodiscard]] int steps_done() const { return done_; }
  [[nodiscard]] bool is_settled() const { return done_ >= options_.steps; }

 private:
  void paint_sky();
  [[nodiscard]] std::vector<ViewPixel> draw_kept() const;

  std::span<const CachedView> views_;
  const KnownColorMap& known_;
  const ColorModel* base_;
  ColorModel& model_;
  RetouchOptions options_;
  int done_ = 0;
};

}  // namespace cnerf
