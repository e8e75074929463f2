#pragma once
/// Splats fitted to pictures of the field.

#include <span>
#include <vector>

#include "bake/splat/options.h"
#include "bake/splat/place.h"
#include "bake/splat/rasterize.h"

namespace cnerf::bake {

/// Of `options.count` splats, how many are to be placed before anything is drawn; the others come where pictures
/// differ.
[[nodiscard]] std::size_t splats_at_first(const SplatOptions& options);
/// Splats at most where so many could be placed: no more than the pictures ask for.
[[nodiscard]] int splats_in_all(const SplatOptions& options, std::size_t placed);

/// Adam on every parameter of the splats that a picture shows, one picture after another. The same result for any
/// number of threads.
class SplatFit {
 public:
  /// @param targets  must outlive this object.  @param near  of the cameras, world units
  SplatFit(std::span<const SplatTarget> targets, const std::vector<PlacedSplat>& placed, const SplatOptions& options,
           double near);

  /// The next of `options.steps`.
  /// @return  the picture's PSNR before it, dB of encoded colour
  double step();
  [[nodiscard]] int steps_done() const { return done_; }
  /// The splats as they are, without those that no picture has shown lately.
  [[nodiscard]] std::vector<Splat> result() const;

 private:
  using Row = SplatRow<float>;

  [[nodiscard]] const SplatTarget& target_of(int step) const;
  double find_loss(const SplatTarget& target, const SplatPicture& picture);
  void update(const SplatGradients& gradients);
  [[nodiscard]] Row rates(std::size_t splat) const;
  void note_errors(const SplatTarget& target);
  [[nodiscard]] bool is_worth_keeping(std::size_t splat) const;
  void renew();

  std::span<const SplatTarget> targets_;
  SplatOptions options_;
  double near_;
  int done_ = 0;
  std::vector<Splat> splats_;
  std::vector<float> spacing_;
  std::vector<Row> first_moments_, second_moments_;
  std::vector<int> last_shown_;      ///< the last step whose picture had something of the splat
  std::vector<PlacedSplat> wanted_;  ///< where pictures of late differed from their targets
  SplatRasterizer rasterizer_;
  SplatPicture d_picture_;
};

}  // namespace cnerf::bake
