#pragma once
/// Key views: which views, once somebody colours them, tell most about the colours of all the others.
///
/// The scene is a set of points p: pixels drawn evenly from all views, so that a surface counts by the pixels that it
/// has in them. A coloured view v tells of a point
///
///   b(v, p) = 1                                                     where v sees p,
///   b(v, p) = kAlike max { exp(-|f(p) - f(q)|² / 2) : v sees q }    elsewhere,
///
/// f being what its surroundings look like: colours come to what no key view sees by its looks. A set S of views tells
///
///   F(S) = Σ_p w_p max_{v in S} b(v, p) / Σ_p w_p,
///
/// w_p being the doubt about the point's colour. F never falls as S grows, and a view adds the less the larger S is:
/// facility location. So views that are chosen greedily tell at least 1 - 1/e of what the best ones would (Nemhauser,
/// Wolsey and Fisher, Mathematical Programming 14, 1978).

#include <array>
#include <span>
#include <vector>

#include "src/train/chroma/color_model.h"
#include "src/train/chroma/known_color_map.h"

namespace cnerf {

/// The points of a scene, as its views show them.
struct ScenePoints {
  static constexpr std::size_t kLooks = 3;
  using Looks = std::array<float, kLooks>;

  std::vector<ViewPixel> pixels;  ///< where each was found
  std::vector<Looks> looks;       ///< f; a distance of 1 makes two of them rather different
  std::vector<float> doubt;       ///< w, not negative; 1 each to begin with
};

/// About `count` points, from each view as many. Pixels that show nothing are none.
[[nodiscard]] ScenePoints scene_points(const SeenSurfaces& seen, std::size_t count = 4000);

/// How far from the mean colour of a distribution its colours are, in the mean over the distribution; ab units.
/// @param logits  [313]
[[nodiscard]] float spread_of(std::span<const float> logits);

/// A take's doubts about the points' colours: how far its distributions are spread.
/// @param take  has a distribution (PixelColors::kDistribution)
[[nodiscard]] std::vector<float> doubts_of(const ColorModel& take, std::span<const CachedView> views,
                                           const ScenePoints& points);

struct KeyView {
  std::size_t view = 0;
  double shows = 0;  ///< share of the points' doubt that lies where it sees them
  double adds = 0;   ///< F(S with it) - F(S)
};

struct KeyViewChoice {
  std::vector<KeyView> alone;   ///< of every view, in their order, what it adds to those that are given
  std::vector<KeyView> chosen;  ///< those that tell most, each beside those before it
};
/// @param given  views that are coloured already: S begins with them
/// @param count  at most so many are chosen; fewer where there are no more, none where nothing is in doubt
[[nodiscard]] KeyViewChoice choose_key_views(const SeenSurfaces& seen, const ScenePoints& points,
                                             std::span<const std::size_t> given, std::size_t count);

}  // namespace cnerf
