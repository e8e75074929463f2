#include "src/prepare/motion_masks.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/statistics.h"
#include "src/color/colorspace_math.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/stage1.h"

namespace cnerf::prepare {
namespace fs = std::filesystem;
namespace {

constexpr double kUsualShare = 0.9;   ///< of all pixels: no more than the rest has moved
constexpr double kUsualFactor = 3;    ///< times their disagreement, from which something may have moved
constexpr double kReach = 0.5;        ///< of the threshold, down to which a moving part extends
constexpr double kBlur = 1.0 / 50;    ///< of the longer side: texture and edges that a quick fit misses average out
constexpr double kSmallest = 0.0015;  ///< of the picture: smaller parts are noise
constexpr int kStepsPerBox = 512;     ///< at which the fit is looked at, and how carefully
constexpr float kLeastTransmittance = 1e-3f, kShadedShare = 0.995f;
constexpr double kMargin = 1.0 / 80;  ///< of the longer side, around what moved: shadows and soft rims

/// A fit that settles quickly and has no room for what only single views show.
Stage1Options quick_fit(const MotionMaskOptions& options) {
  Stage1Options fit;
  fit.steps = options.motion_steps;
  fit.samples_per_step = 32768;
  fit.final_learning_rate = 1e-3;
  fit.checkpoint_every = 0;
  fit.grid.log2_rows = 15;
  fit.grid.finest_resolution = 256;
  return fit;
}

float encoded(float luminance) {
  return srgb_from_linear(std::clamp(luminance, 0.0f, 1.0f));
}

/// How far the field is from the view, blurred; 0 where the view says nothing.
cv::Mat1f disagreement(const View& view, const std::vector<RayResult>& field) {
  cv::Mat1f difference(view.image.height, view.image.width, 0.0f);
  for (std::size_t p = 0; p < view.image.pixel_count(); ++p) {
    if (!view.image.valid(p)) continue;
    difference(int(p) / view.image.width, int(p) % view.image.width) =
        encoded(field[p].luminance) - encoded(view.image.luminance(p));
  }
  cv::GaussianBlur(difference, difference, {}, std::max(1.0, kBlur * std::max(difference.cols, difference.rows)));
  return cv::abs(difference);
}

/// What the fit shows where the view is.  [H, W]
std::vector<RayResult> rendered(const LuminanceModel& fit, const View& view) {
  const UnitCamera camera(view.intrinsics, view.world_from_camera, fit.frame);
  std::vector<RayResult> results(std::size_t(view.intrinsics.width) * std::size_t(view.intrinsics.height));
  fit.engine->render_view(camera, fit.march(kStepsPerBox), {kLeastTransmittance, kShadedShare}, results);
  return results;
}

/// Reports the progress of a part of the work as that of the whole.
class PartOfMotion final : public Observer {
 public:
  PartOfMotion(Observer& whole, double from, double to) : whole_(whole), from_(from), to_(to) {}
  void report_progress(const Progress& progress) override {
    whole_.report_progress({"motion", from_ + (to_ - from_) * progress.fraction, {}});
  }
  [[nodiscard]] bool is_cancelled() const override { return whole_.is_cancelled(); }

 private:
  Observer& whole_;
  double from_, to_;
};

std::vector<float> values_of(const std::vector<cv::Mat1f>& images) {
  std::vector<float> values;
  for (const cv::Mat1f& image : images) values.insert(values.end(), image.begin(), image.end());
  return values;
}

/// Parts above the lower threshold that are large enough and reach the upper one somewhere, with a margin.
cv::Mat1b moving_parts(const cv::Mat1f& disagreement, double threshold) {
  cv::Mat1i labels;
  cv::Mat1i stats;
  cv::Mat1d centres;
  const cv::Mat1b candidates = disagreement > kReach * threshold;
  const int count = cv::connectedComponentsWithStats(candidates, labels, stats, centres);
  std::vector<float> peak(std::size_t(count), 0.0f);
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      float& most = peak[std::size_t(labels(y, x))];
      most = std::max(most, disagreement(y, x));
    }
  }
  cv::Mat1b moving(labels.size(), std::uint8_t(0));
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      const int part = labels(y, x);
      const bool large = stats(part, cv::CC_STAT_AREA) > kSmallest * double(labels.total());
      if (part != 0 && large && peak[std::size_t(part)] > threshold) moving(y, x) = 255;
    }
  }
  const int reach = std::max(1, int(std::lround(kMargin * std::max(labels.cols, labels.rows))));
  cv::dilate(moving, moving, cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * reach + 1, 2 * reach + 1}));
  return moving;
}

}  // namespace

std::vector<MotionMask> find_motion(const Capture& capture, const MotionMaskOptions& options, const fs::path& work,
                                    const Engines& engines, Observer& observer) {
  const fs::path snapshot = work / "motion.snapshot";
  PartOfMotion fit(observer, 0, 0.8), comparison(observer, 0.8, 1);
  make_folders(work);
  Capture all = capture;  // held-out views move too, and are told best by a fit that has seen them
  for (View& view : all.views) view.held_out = false;
  train_stage1({all, quick_fit(options), snapshot}, engines, fit);
  const LuminanceModel model = LuminanceModel::load(snapshot, engines);
  std::vector<cv::Mat1f> differences;
  for (const View& view : capture.views) {
    if (observer.is_cancelled()) throw Interrupted("stopped while looking for motion");
    differences.push_back(disagreement(view, rendered(model, view)));
    comparison.report_progress({"", double(differences.size()) / double(capture.views.size()), {}});
  }
  fs::remove(snapshot);
  const double threshold =
      std::max(options.motion_difference, kUsualFactor * double(quantile(values_of(differences), kUsualShare)));
  std::vector<MotionMask> masks;
  for (const cv::Mat1f& difference : differences) {
    const cv::Mat1b moving = moving_parts(difference, threshold);
    MotionMask mask;
    mask.width = moving.cols;
    mask.height = moving.rows;
    mask.share = double(cv::countNonZero(moving)) / double(moving.total());
    if (mask.share <= options.motion_largest) {
      const cv::Mat1b valid = 255 - moving;
      mask.valid.assign(valid.begin(), valid.end());
    }
    masks.push_back(std::move(mask));
  }
  return masks;
}

}  // namespace cnerf::prepare
