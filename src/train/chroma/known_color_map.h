#pragma once
/// Known color map: what is known of the pixels of all cached views, their own colours and those of others that show
/// the same surface.

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/train/chroma/known_colors.h"
#include "src/train/chroma/likeness.h"

namespace cnerf {

/// What views see, for carrying colours from one to another. Refers to the views and their names.
class SeenSurfaces {
 public:
  using Surface = std::shared_ptr<const std::vector<float>>;

  /// @param names  [views] of the cached views
  SeenSurfaces(std::span<const CachedView> views, std::span<const std::string> names)
      : SeenSurfaces(views, names, {}) {}
  /// @param surfaces  of the first of the views, where they are known already
  SeenSurfaces(std::span<const CachedView> views, std::span<const std::string> names,
               std::span<const Surface> surfaces);

  [[nodiscard]] std::span<const CachedView> views() const { return views_; }
  [[nodiscard]] std::span<const std::string> names() const { return names_; }
  [[nodiscard]] std::span<const Surface> surfaces() const { return surfaces_; }
  /// The first of the views alone.
  [[nodiscard]] SeenSurfaces first(std::size_t count) const {
    return {views_.first(count), names_.first(count), std::span(surfaces_).first(count)};
  }
  /// Number of the view of that name.  @throws UsageError  when it is none of them.
  [[nodiscard]] std::size_t view_named(const std::string& name) const;
  /// `surface_distance` of a view.
  [[nodiscard]] std::span<const float> surface(std::size_t view) const { return *surfaces_[view]; }

 private:
  std::span<const CachedView> views_;
  std::span<const std::string> names_;
  std::vector<Surface> surfaces_;
};

/// What a view sees of points of the scene: the same surface, and it looks the same. Refers to both.
class Sight {
 public:
  /// @param surface  `surface_distance(view)`
  Sight(const CachedView& view, std::span<const float> surface);

  /// The pixel that shows the point; nothing where another surface is before it, or none.
  /// @param point      unit space
  /// @param lightness  L* where it was seen from elsewhere
  [[nodiscard]] std::optional<std::size_t> pixel_of(Vec3d point, float lightness) const;

 private:
  const CachedView& view_;
  std::span<const float> surface_;
  Mat3d camera_from_unit_;
};

/// Colours that a user gave, spread over the views that they were given on, ready to be looked at from any view.
class KnownColorSources {
 public:
  /// Refers to `seen`.  @throws UsageError  when a view that is known is none of them.
  KnownColorSources(const SeenSurfaces& seen, std::span<const KnownColors> known);

  /// What is known of a view's pixels: its own colours, those of others that show the same surface, and of strokes what
  /// these run to from there. Strokes correct what a key frame says, and of two the later.
  [[nodiscard]] RunningColors seen_in(std::size_t view) const;

  struct Source {
    std::size_t view;
    KnownColorKind kind;
    RunningColors colors;  ///< at the size of the cached view, where they have run to
    std::shared_ptr<const StrokesEverywhere> everywhere = {};  ///< null: they have a reach
  };
  [[nodiscard]] std::span<const Source> sources() const { return sources_; }

 private:
  [[nodiscard]] bool is_everywhere() const;
  [[nodiscard]] RunningColors everywhere_in(std::size_t view) const;

  const SeenSurfaces& seen_;
  std::vector<Source> sources_;
};

class KnownColorMap {
 public:
  using OfView = std::shared_ptr<const RunningColors>;

  /// Nothing is known.
  KnownColorMap() = default;
  KnownColorMap(const SeenSurfaces& seen, const KnownColorSources& sources);
  /// @param colors  `seen_in` of each view, of sources without key frames
  explicit KnownColorMap(std::vector<OfView> colors);

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
  void add_key_frame(const KnownColorSources::Source& source);
  void list_places();

  std::vector<OfView> colors_;  // [views]; empty where nothing is known at all
  std::vector<ViewPixel> places_;
  std::vector<KeyFrame> key_frames_;
};

/// Of colours as they were given.  @throws as KnownColorSources
[[nodiscard]] KnownColorMap known_color_map(std::span<const CachedView> views, std::span<const std::string> names,
                                            std::span<const KnownColors> known);

}  // namespace cnerf
