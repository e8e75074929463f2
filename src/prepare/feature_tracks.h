#pragma once
/// Features of a capture's training views, matched along epipolar lines, and the points that they show.

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "src/base/observer.h"
#include "src/capture/capture.h"

namespace cnerf::prepare {

/// A point, and where views show it.
struct Track {
  struct Sighting {
    std::uint32_t view = 0;  ///< its place in `Capture::views`
    PixelPosition pixel;     ///< of the view's own picture
  };

  Vec3d position;                   ///< world
  double error = 0;                 ///< mean distance from its sightings, pixels of `FeatureTracks::kLongestSide`
  std::vector<Sighting> sightings;  ///< by ascending view, each once
};

[[nodiscard]] SparsePoint point_of(const Track& track);

/// Held-out views are not looked at. The same capture gives the same tracks.
class FeatureTracks {
 public:
  static constexpr int kLongestSide = 1000;       ///< pixels at which features are looked for
  static constexpr std::size_t kFewestViews = 3;  ///< of a point: of two, one in many is a coincidence

  struct ViewFeatures {
    std::vector<PixelPosition> pixels;  ///< of the view's own picture
    cv::Mat1f descriptors;              ///< [features, 128], unit length
    double pixel_per_own = 1;           ///< pixels of `kLongestSide` per one of the view's own
  };

  /// Finds the features. The observer is told how far it is.
  /// @throws Interrupted  when the observer cancels; after a few views at most
  FeatureTracks(const Capture& capture, Observer& observer);

  /// Points that at least `kFewestViews` views show, from directions that differ, with the cameras that the capture has
  /// now.
  /// @param tolerance  pixels of `kLongestSide` that a feature may lie off its epipolar line, and off its point
  /// @throws Interrupted  likewise
  [[nodiscard]] std::vector<Track> triangulated(const Capture& capture, double tolerance, Observer& observer) const;

  [[nodiscard]] const ViewFeatures& of_view(std::size_t view) const { return features_[view]; }
  /// Mean distance of a track's point from its sightings, with the cameras that the capture has now.
  [[nodiscard]] double error_of(const Track& track, const Capture& capture) const;

 private:
  std::vector<ViewFeatures> features_;
};

}  // namespace cnerf::prepare
