#pragma once
/// Colours the user knows: painted frames of the capture (key frames) and strokes on its views (hints). They are
/// trained on directly, through the camera of their view, and in every other view that shows the same surface. So one
/// painted photograph colours the scene, and one stroke an object.

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "src/capture/camera_record.h"
#include "src/color/ab_bins.h"
#include "src/train/luminance/view_cache.h"

namespace cnerf {

enum class KnownColorKind {
  kKeyFrame,  ///< a whole picture
  kStrokes,   ///< some pixels; their colours run over the surface around them
};

/// Colours of one training view or viewpoint, at any size of the view's shape.
struct KnownColors {
  KnownColorKind kind = KnownColorKind::kKeyFrame;
  std::string view;  ///< its name, as the capture has it
  int width = 0, height = 0;
  std::vector<Ab> ab;                  ///< [H, W]
  std::vector<std::uint8_t> is_known;  ///< [H, W] 0 or 1
  std::vector<float> reach = {};       ///< [H, W] of strokes, times StrokeReach; 0: stays there; empty = 1 everywhere
  bool everywhere = false;             ///< of strokes: they colour all that there is, see likeness.h
};

/// For logs, metadata and comparing runs: " + key frame images/0007.png (1a2b3c4d)"; empty without any.
[[nodiscard]] std::string describe(std::span<const KnownColors> known);
/// And of where it was painted: " + viewpoint-1 (1a2b3c4d)".
[[nodiscard]] std::string describe_viewpoints(std::span<const Viewpoint> viewpoints);

/// How far a stroke's colour runs: until the way to a pixel has cost 1, where each of these costs as much.
struct StrokeReach {
  float share_of_short_side = 0.5f;  ///< of the picture, in the plane
  float lightness = 12;              ///< L* up and down
  float depth = 0.1f;                ///< of the distance, nearer and farther
};

inline constexpr float kUnreached = std::numeric_limits<float>::infinity();

/// Colours that run over the pixels of a view.  [H, W] each
struct RunningColors {
  std::vector<Ab> ab;
  std::vector<float> reach;  ///< how far they run, times StrokeReach
  std::vector<float> cost;   ///< of the way from the stroke; kUnreached where nothing is known

  [[nodiscard]] bool is_known(std::size_t pixel) const { return cost[pixel] < kUnreached; }
};

/// Strokes before they run.
[[nodiscard]] RunningColors running_colors(const KnownColors& strokes);

/// Gives pixels the colour that comes to them at the least cost, as far as it reaches.
/// @param surface  `surface_distance(view)`
void run(RunningColors& colors, const CachedView& view, std::span<const float> surface, const StrokeReach& reach = {});

/// L* of a pixel, 0..100.
[[nodiscard]] float lightness_at(const CachedView& view, std::size_t pixel);

/// Distance to where half of a pixel's weight lies, unit space; 0 for a pixel that is hardly opaque.  [H, W]
[[nodiscard]] std::vector<float> surface_distance(const CachedView& view);

/// The colours at the size of a cached view. A pixel of a key frame is known where most of what it covers is, one of
/// strokes, which may be thin, where anything is; it has the mean of what is known.
[[nodiscard]] KnownColors resized_to(const KnownColors& known, const CachedView& view);

}  // namespace cnerf
