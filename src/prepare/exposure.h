#pragma once
/// Relative exposures of the views, which differ by shutter, iris or the flicker of a film, estimated from places that
/// several views show.

#include <filesystem>
#include <optional>
#include <vector>

#include "src/prepare/photographs.h"

namespace cnerf::prepare {

/// The light a view shows of a place.
struct Sighting {
  int view = 0;      ///< number
  int place = 0;     ///< number
  double light = 0;  ///< linear luminance, above 0
};

/// Exposures e such that light of view v and place p is e_v times the light of p, in the sense of least absolute
/// differences of logarithms (by reweighted least squares, the places eliminated), so that wrong and shiny places
/// hardly pull. Their median is 1; views without sightings get 1. Groups of views that share no place with each other
/// keep an unknown factor between them, taken as 1.
[[nodiscard]] std::vector<double> solve_exposures(int views, const std::vector<Sighting>& sightings);

/// How a view was taken: light of view v and place p is exposure_v times the light of p, plus haze_v.
struct ViewLight {
  double exposure = 1;
  double haze = 0;  ///< fog of the film, stray light; linear, 1 = white
};
/// The same with light that lies over each view. The least hazy view has none, the median exposure is 1; views of fewer
/// than kSightingsForHaze sightings get their exposure alone.
inline constexpr int kSightingsForHaze = 50;
[[nodiscard]] std::vector<ViewLight> solve_exposures_and_haze(int views, const std::vector<Sighting>& sightings);

/// The spread of exposures from which they are kept: relative standard deviation. Below it, differences are as likely
/// shine and noise.
inline constexpr double kNotedExposure = 0.02;

/// Fills `exposure` of the images from what they show of the model's points, and `haze` if asked to; leaves 1 and 0
/// where exposures spread less than kNotedExposure.
/// @return  the spread found; nothing when the model names no point in the images, or none that is neither dark nor
///          clipped there
std::optional<double> estimate_exposures(std::vector<PreparedImage>& images, const std::filesystem::path& capture,
                                         const std::filesystem::path& model, bool with_haze);

}  // namespace cnerf::prepare
