#pragma once
/// Known strokes: what a list of strokes makes known of all that is seen, each view looked at once, whoever asks. Pages
/// want thumbnails of it, and the colours are learned from it.

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "src/train/chroma/known_color_map.h"
#include "src/train/chroma/strokes.h"

namespace cnerf::studio {

/// What strokes make known, at the sizes of cached views.
[[nodiscard]] std::vector<KnownColors> known_of(const StrokeList& list, const SeenSurfaces& seen);

/// Nothing is looked at before it is asked for. Functions may be called at the same time.
class KnownStrokes {
 public:
  /// Refers to the views that are seen.
  KnownStrokes(const StrokeList& list, const SeenSurfaces& seen);

  /// Whether this is of such a list, whatever its revision.
  [[nodiscard]] bool is_of(const StrokeList& list) const;
  [[nodiscard]] const std::vector<KnownColors>& painted() const { return painted_; }
  /// Of a view, by its number.  @throws UsageError  strokes are in a view that is not seen
  [[nodiscard]] KnownColorMap::OfView in(std::size_t view) const;
  /// Of the first views.  @throws as `in`
  [[nodiscard]] KnownColorMap map(std::size_t views) const;

 private:
  struct View {
    std::once_flag is_seen;
    KnownColorMap::OfView colors;
  };
  void spread() const;  ///< the colours in the views that were painted on

  SeenSurfaces seen_;
  std::string list_;
  std::vector<KnownColors> painted_;
  mutable std::once_flag are_spread_;
  mutable std::optional<KnownColorSources> sources_;
  mutable std::vector<View> views_;
};

}  // namespace cnerf::studio
