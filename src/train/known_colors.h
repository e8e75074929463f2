#pragma once
/// Colours the user knows: painted frames of the capture (key frames) and strokes on its views (hints). They are
/// trained on directly, through the camera of their view, and in every other view that shows the same surface. So one
/// painted photograph colours the scene, and one stroke an object.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "src/color/ab_bins.h"
#include "src/train/view_cache.h"

namespace cnerf {

enum class KnownColorKind {
  kKeyFrame,  ///< a whole picture
  kStrokes,   ///< some pixels; their colours run over the surface around them
};

/// Colours of one training view, at any size of the view's shape.
struct KnownColors {
  KnownColorKind kind = KnownColorKind::kKeyFrame;
  std::string view;  ///< name of the view, as the capture has it
  int width = 0, height = 0;
  std::vector<Ab> ab;                  ///< [H, W]
  std::vector<std::uint8_t> is_known;  ///< [H, W] 0 or 1
};

/// For logs, metadata and comparing runs: " + key frame images/0007.png (1a2b3c4d)"; empty without any.
[[nodiscard]] std::string describe(std::span<const KnownColors> known);

/// How far a stroke's colour runs: until the way to a pixel has cost 1, where each of these costs as much.
struct StrokeReach {
  float share_of_short_side = 0.5f;  ///< of the picture, in the plane
  float lightness = 12;              ///< L* up and down
  float depth = 0.1f;                ///< of the distance, nearer and farther
};

/// Gives pixels around the strokes the colour of the stroke that is nearest by that cost.
/// @param strokes  at the view's size
/// @param surface  `surface_distance(view)`
[[nodiscard]] KnownColors spread(const KnownColors& strokes, const CachedView& view, std::span<const float> surface,
                                 const StrokeReach& reach = {});

/// Distance to where half of a pixel's weight lies, unit space; 0 for a pixel that is hardly opaque.  [H, W]
[[nodiscard]] std::vector<float> surface_distance(const CachedView& view);

/// What is known of the pixels of all cached views.
class KnownColorMap {
 public:
  KnownColorMap() = default;
  /// @param names  [views] of the cached views
  /// @throws UsageError  when a name is none of them.
  KnownColorMap(const std::vector<CachedView>& views, std::span<const std::string> names,
                std::span<const KnownColors> known);

  /// Null where nothing is known.
  [[nodiscard]] const Ab* find(std::size_t view, std::uint32_t pixel) const;
  /// All known pixels, view by view.
  [[nodiscard]] std::span<const ViewPixel> places() const { return places_; }

  /// A view that was given as a key frame, with its colours at the cached view's size, [2, H, W].
  struct KeyFrame {
    std::size_t view = 0;
    std::vector<float> ab;
  };
  [[nodiscard]] std::span<const KeyFrame> key_frames() const { return key_frames_; }

 private:
  std::vector<std::vector<Ab>> ab_;  // [views][H, W]; empty where a view has none
  std::vector<std::vector<std::uint8_t>> is_known_;
  std::vector<ViewPixel> places_;
  std::vector<KeyFrame> key_frames_;
};

}  // namespace cnerf
