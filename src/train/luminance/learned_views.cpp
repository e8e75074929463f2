#include "src/train/luminance/learned_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/statistics.h"
#include "src/train/luminance/luminance_model.h"

namespace cnerf {
namespace {

// A camera that is further off was not placed badly: its pose belongs to another picture, or the capture to no scene.
constexpr double kMostDegrees = 2, kMostShift = 0.02;  ///< of the innermost box's side
constexpr std::size_t kMostFacts = 8;                  // views may have a lens each
constexpr double kDegrees = 180 / std::numbers::pi;

/// Names of the cameras that were moved further than a badly placed one would be.
std::string stray_cameras(const LearnedViews& learned, const std::vector<std::string>& names) {
  const double most_shift = kMostShift * std::ldexp(1.0, 1 - learned.frame.cascades);  // unit space
  std::string strays;
  for (std::size_t v = 0; v < learned.corrections.size(); ++v) {
    const ViewCorrection& correction = learned.corrections[v];
    const bool is_near = kDegrees * length(correction.turn) < kMostDegrees && length(correction.shift) < most_shift;
    if (!is_near) strays += (strays.empty() ? "" : ", ") + names[v];
  }
  return strays;
}

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

/// Mean of the nearest known gains before and after a view, itself left out. 0 where there are none.
float of_neighbours(const std::vector<float>& gains, std::size_t view) {
  float sum = 0;
  int found = 0;
  for (const int way : {-1, 1}) {
    for (auto v = std::ptrdiff_t(view) + way; v >= 0 && v < std::ptrdiff_t(gains.size()); v += way) {
      if (std::isnan(gains[std::size_t(v)])) continue;
      sum += gains[std::size_t(v)];
      ++found;
      break;
    }
  }
  return found > 0 ? sum / float(found) : 0;
}

/// Whether neighbours say more of a view's exposure than the median does, asked of the views whose exposure is known.
bool neighbours_tell(const std::vector<float>& gains) {
  double by_neighbours = 0, by_median = 0;
  for (std::size_t v = 0; v < gains.size(); ++v) {
    if (std::isnan(gains[v])) continue;
    const double off = gains[v] - of_neighbours(gains, v);
    by_neighbours += off * off;
    by_median += double(gains[v]) * gains[v];
  }
  return by_neighbours < by_median;
}

Mat3d turned_axes(const Mat3d& axes, Vec3d turn) {
  return Mat3d::from_columns(turned(turn, axes.column(0)), turned(turn, axes.column(1)), turned(turn, axes.column(2)));
}

std::string lens_text(const LensCorrection& lens) {
  return fmt::format("focal length times {:.4f}, k1 {:+.4f}, k2 {:+.4f}", std::exp(lens.log_focal), lens.k1, lens.k2);
}
/// Before and after.
std::string lens_text(const LensCorrection& lens, const Intrinsics& given) {
  const Intrinsics found = lens.applied_to(given);
  std::string text = fmt::format(
      "focal length times {:.4f} ({:.1f} -> {:.1f} pixels), principal point {:.1f}, {:.1f} -> {:.1f}, {:.1f}",
      std::exp(lens.log_focal), given.fx, found.fx, given.cx, given.cy, found.cx, found.cy);
  if (given.model == LensModel::kOpenCvFisheye) return text;  // whose distortion is not learned
  constexpr std::array<const char*, 4> kNames = {"k1", "k2", "p1", "p2"};
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    text += fmt::format(", {} {:+.4f} -> {:+.4f}", kNames[i], given.distortion[i], found.distortion[i]);
  }
  return text;
}

}  // namespace

Affined corrected_pose(const Affined& world_from_camera, const ViewCorrection& correction, const SceneFrame& frame) {
  return {turned_axes(world_from_camera.linear, correction.turn.cast<double>()),
          world_from_camera.translation + correction.shift.cast<double>() / frame.unit_per_world};
}

Affined given_pose(const Affined& world_from_camera, const ViewCorrection& correction, const SceneFrame& frame) {
  return {turned_axes(world_from_camera.linear, -correction.turn.cast<double>()),
          world_from_camera.translation - correction.shift.cast<double>() / frame.unit_per_world};
}

std::vector<LearnedFact> facts_of(const LearnedViews& learned, std::span<const Intrinsics> given) {
  std::vector<double> gains, turns, shifts;
  for (const ViewCorrection& correction : learned.corrections) {
    gains.push_back(correction.gain());
    turns.push_back(kDegrees * length(correction.turn));
    shifts.push_back(100 * std::ldexp(double(length(correction.shift)), learned.frame.cascades - 1));
  }
  std::vector<LearnedFact> facts;
  if (gains.empty()) return facts;
  if (const auto [least, most] = std::ranges::minmax(gains); least < most) {
    facts.push_back({"exposures", fmt::format("{:.2f} to {:.2f} of the median view's", least, most)});
  }
  if (std::ranges::max(turns) > 0) {
    facts.push_back(
        {"cameras", fmt::format("turned by {:.2f} degrees, moved by {:.2f} % of the innermost box (medians; "
                                "at most {:.2f}, {:.2f})",
                                median(turns), median(shifts), std::ranges::max(turns), std::ranges::max(shifts))});
  }
  const bool knows_given = given.size() == learned.lenses.size();
  for (std::size_t l = 0; l < learned.lenses.size() && facts.size() < kMostFacts; ++l) {
    facts.push_back({"lens", knows_given ? lens_text(learned.lenses[l], given[l]) : lens_text(learned.lenses[l])});
  }
  return facts;
}

std::vector<float> log_gains(const Capture& capture, std::span<const ViewCorrection> corrections) {
  CNERF_CHECK_EQ(std::size_t(std::ranges::count(capture.views, false, &View::held_out)), corrections.size());
  std::vector<float> gains;
  std::size_t next = 0;
  for (const View& view : capture.views) gains.push_back(view.held_out ? kUnknown : corrections[next++].log_gain);
  if (!neighbours_tell(gains)) {
    std::ranges::replace_if(
        gains, [](float gain) { return std::isnan(gain); }, 0.0f);
    return gains;
  }
  std::vector<float> all = gains;
  for (std::size_t v = 0; v < all.size(); ++v) {
    if (std::isnan(all[v])) all[v] = of_neighbours(gains, v);
  }
  return all;
}

void apply_learned_views(Capture& capture, const LearnedViews& learned) {
  if (learned.corrections.empty()) return;
  const std::vector<float> gains = log_gains(capture, learned.corrections);
  const std::vector<Intrinsics> lenses = lenses_of(capture);
  std::size_t next = 0;
  for (std::size_t v = 0; v < gains.size(); ++v) {
    View& view = capture.views[v];
    view.image.exposure *= std::exp(gains[v]);
    const auto lens = std::size_t(std::ranges::find(lenses, view.intrinsics) - lenses.begin());
    if (lens < learned.lenses.size()) view.intrinsics = learned.lenses[lens].applied_to(view.intrinsics);
    if (view.held_out) continue;
    view.world_from_camera = corrected_pose(view.world_from_camera, learned.corrections[next++], learned.frame);
  }
}

std::vector<std::string> apply_learned_views(Capture& capture, const std::filesystem::path& stage1_snapshot) {
  const LearnedViews learned = LuminanceModel::learned_views_in(stage1_snapshot);
  refuse_other_cameras(stage1_snapshot, LuminanceModel::trained_on_in(stage1_snapshot).cameras, capture);
  std::vector<std::string> names;
  for (const View& view : capture.views) {
    if (!view.held_out) names.push_back(view.name);
  }
  if (!learned.corrections.empty() && names.size() != learned.corrections.size()) {
    throw SnapshotError(
        fmt::format("{}: learned of {} views, but the capture has {} to train on; was it changed, or "
                    "capture.holdout?",
                    stage1_snapshot.string(), learned.corrections.size(), names.size()));
  }
  if (!learned.lenses.empty() && lenses_of(capture).size() != learned.lenses.size()) {
    throw SnapshotError(fmt::format("{}: learned of {} lenses, but the capture has {}", stage1_snapshot.string(),
                                    learned.lenses.size(), lenses_of(capture).size()));
  }
  const std::vector<LearnedFact> facts = facts_of(learned, lenses_of(capture));
  apply_learned_views(capture, learned);
  std::vector<std::string> lines;
  for (const auto& [name, text] : facts) lines.push_back(name + ": " + text);
  const std::string strays = stray_cameras(learned, names);
  if (!strays.empty()) lines.push_back("note: these poses are not inexact but wrong, by the look of it: " + strays);
  return lines;
}

}  // namespace cnerf
