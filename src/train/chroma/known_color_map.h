#pragma once
/// Known color map: what is known of the pixels of all cached views, their own colours and those of others that show
/// the same surface.

#include <span>
#include <string>
#include <vector>

#include "src/train/chroma/known_colors.h"

namespace cnerf {

class KnownColorMap {
 public:
  /// @param names  [views] of the cached views
  /// @throws UsageError  when a view that is known is none of them.
  KnownColorMap(std::span<const CachedView> views, std::span<const std::string> names,
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
  /// Colours of a view, wherever they were given.
  struct ViewColors {
    std::vector<Ab> ab;                  // [H, W]
    std::vector<std::uint8_t> is_known;  // [H, W]
  };
  struct Source;
  struct Sight;
  void add_key_frame(const Source& source);
  [[nodiscard]] static ViewColors colors_seen_in(std::size_t view, std::span<const CachedView> views,
                                                 std::span<const Source> sources,
                                                 std::span<const std::vector<float>> surfaces);
  void list_places();

  std::vector<ViewColors> colors_;  // [views]; empty where nothing is known at all
  std::vector<ViewPixel> places_;
  std::vector<KeyFrame> key_frames_;
};

}  // namespace cnerf
