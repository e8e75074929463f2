#pragma once
/// Compares a trained scene with the photographs it was not trained on, and with their colours where they are known.

#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/base/progress.h"
#include "src/base/record.h"
#include "src/capture/capture.h"
#include "src/capture/color_truth.h"
#include "src/colorizer/picture_encoder.h"
#include "src/evaluate/lpips.h"
#include "src/evaluate/metrics.h"
#include "src/evaluate/pose_alignment.h"
#include "src/train/scene.h"

namespace cnerf {

inline constexpr int kMetricsSchemaVersion = 1;

/// What one view measures. A number that has no meaning for the view (no colour truth, not colorized) is absent.
struct ViewMetrics {
  std::string view;
  std::vector<float> features_ours, features_truth;  ///< as PictureEncoder has them, until they are summarised
  std::optional<double> psnr_luminance;              ///< dB; sRGB-encoded Rec.709 Y, clamped to [0, 1]
  /// The same with the one gain of linear light that fits the view best: of a picture whose exposure nobody knows.
  std::optional<double> psnr_luminance_exposure_fitted;
  /// Of the right half of the picture, pose and gain fitted on the left half: of a held-out view whose pose nobody
  /// knows exactly. To be compared with its like alone.
  std::optional<double> psnr_luminance_aligned;
  std::optional<double> near_opacity;  ///< mean opacity of the first tenth of rays: 0 where the camera stands free
  std::optional<double> psnr_rgb;      ///< dB; sRGB-encoded values of all three channels
  std::optional<double> ssim;          ///< of encoded luminance
  std::optional<double> ssim_rgb;      ///< mean of the three encoded channels
  std::optional<double> lpips;         ///< of 8-bit sRGB, where weights were given, from Lpips::kLeastSide on
  std::optional<double> colorfulness, colorfulness_truth, colorfulness_difference;  ///< difference: ours - truth
  std::optional<double> colorfulness_magnitude, colorfulness_magnitude_truth, colorfulness_magnitude_difference;
  std::optional<double> color_diversity, color_diversity_truth, color_diversity_difference;  ///< likewise
  std::optional<double> ab_error;          ///< mean Lab ab distance to the truth
  std::optional<double> ab_error_grey;     ///< what an all-grey picture would get
  std::optional<double> bake_ab_distance;  ///< per-pixel decode against composited per-sample colour, opacity >= 0.01

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& visitor) {
    visitor("view", self.view, kOptional);
    visit_numbers(self, visitor);
  }
  /// Calls `visitor(name, number)` for each number; the one list of them.
  template <typename Self, typename Visitor>
  static void visit_numbers(Self& self, Visitor&& visitor) {
    visitor("psnr_luminance", self.psnr_luminance);
    visitor("psnr_luminance_exposure_fitted", self.psnr_luminance_exposure_fitted);
    visitor("psnr_luminance_aligned", self.psnr_luminance_aligned);
    visitor("near_opacity", self.near_opacity);
    visitor("psnr_rgb", self.psnr_rgb);
    visitor("ssim", self.ssim);
    visitor("ssim_rgb", self.ssim_rgb);
    visitor("lpips", self.lpips);
    visitor("colourfulness", self.colorfulness);
    visitor("colourfulness_truth", self.colorfulness_truth);
    visitor("colourfulness_difference", self.colorfulness_difference);
    visitor("colourfulness_magnitude", self.colorfulness_magnitude);
    visitor("colourfulness_magnitude_truth", self.colorfulness_magnitude_truth);
    visitor("colourfulness_magnitude_difference", self.colorfulness_magnitude_difference);
    visitor("colour_diversity", self.color_diversity);
    visitor("colour_diversity_truth", self.color_diversity_truth);
    visitor("colour_diversity_difference", self.color_diversity_difference);
    visitor("ab_error", self.ab_error);
    visitor("ab_error_grey", self.ab_error_grey);
    visitor("bake_ab_distance", self.bake_ab_distance);
  }
};

/// How a number is spread over the views: a mean hides a view that is lost. Quantiles count from the worst.
struct Spread {
  double worst = 0;
  std::string worst_view;
  double tenth = 0, quarter = 0, median = 0;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& visitor) {
    visitor("worst", self.worst);
    visitor("worst_view", self.worst_view);
    visitor("tenth", self.tenth);
    visitor("quarter", self.quarter);
    visitor("median", self.median);
  }
};

struct Metrics {
  int schema_version = kMetricsSchemaVersion;
  std::string split;            ///< "held-out", or "train" when nothing was held out
  std::string take, colorizer;  ///< filled in by the caller; empty = not colorized
  ViewMetrics mean;             ///< mean over the views that have the number; of dB for PSNR
  /// `frechet_distance` of the optional encoder's features of all views, ours and the truth's; where it is installed.
  std::optional<double> feature_distance;
  std::map<std::string, Spread> spread;  ///< of the numbers of luminance that were measured, by name
  std::vector<ViewMetrics> views;

  /// metrics.json
  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& visitor) {
    visitor("schema_version", self.schema_version);
    visitor("split", self.split);
    visitor("take", self.take);
    visitor("colorizer", self.colorizer);
    visitor("mean", self.mean);
    visitor("feature_distance", self.feature_distance, kOptional);
    visitor("spread", self.spread, kOptional);
    visitor("views", self.views);
  }
};

/// The pictures behind one view's numbers.
struct EvaluatedView {
  const View& view;
  const RenderedImage& ours;
  const std::optional<ColorImage>& truth;
};

struct EvaluateOptions {
  RenderOptions render;
  int training_views = 8;                   ///< at most so many, evenly spread, when nothing was held out
  const Lpips* lpips = nullptr;             ///< measures LPIPS too; the networks run one view at a time
  const PictureEncoder* encoder = nullptr;  ///< measures the distance of features too
  bool with_baked = true;                   ///< also compares the bake's colours with the per-pixel decode
  bool grey_as_color = false;               ///< an uncoloured scene counts as one that was coloured grey
  /// From the file's frame to that of the learned cameras: held-out views are judged aligned as well, which takes as
  /// long as rendering them a few times. None: they are not.
  std::optional<PoseAlignment> alignment = {};
};

/// The views `evaluate` looks at: the held-out ones, or some training views when there are none.
[[nodiscard]] std::vector<const View*> views_to_evaluate(const Capture& capture, const EvaluateOptions& options);

/// Metrics::split of such views.
[[nodiscard]] std::string split_of(const std::vector<const View*>& views);
/// With as many of them as there are metrics.
[[nodiscard]] Progress progress_of(const Metrics& metrics, std::size_t views);

/// Renders and measures each view; hands its pictures to `watch` before they are dropped.
/// @throws Interrupted  when the user asked to stop; nothing is saved.
[[nodiscard]] Metrics evaluate(const Scene& scene, const Capture& capture, const EvaluateOptions& options,
                               const std::function<void(const EvaluatedView&)>& watch = {},
                               const ProgressSink& progress = {});

/// The same for some views at once, which takes memory for each; `evaluate` is this over all.
[[nodiscard]] std::vector<ViewMetrics> evaluate_views(const Scene& scene, std::span<const View* const> views,
                                                      const EvaluateOptions& options,
                                                      const std::function<void(const EvaluatedView&)>& watch = {});

/// Measures one pair of pictures; `evaluate` is this over all views, and LPIPS. Thread-safe.
[[nodiscard]] ViewMetrics measure(const EvaluatedView& pictures);

/// The mean over the views that have a number, for each number.
[[nodiscard]] ViewMetrics mean_of(const std::vector<ViewMetrics>& views);
/// Fills in what is said of all views: mean, spread and distance of features.
void summarise(Metrics& metrics);
[[nodiscard]] std::map<std::string, Spread> spread_of(const std::vector<ViewMetrics>& views);

}  // namespace cnerf
