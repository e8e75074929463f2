#include "src/compare/baselines/simulated.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/capture/color_truth.h"
#include "src/color/ab_bins.h"
#include "src/color/colorspace_math.h"

namespace cnerf::compare {
namespace {

constexpr float kSecondModeChroma = 0.35f;  // of the true chroma, in the washed-out mode
constexpr Ab kBrown = {6, 14};              // and what is added to it
constexpr float kCastChroma = 25;           // of an outlier's colour cast
constexpr float kBiasPeriod = 2.0f / 3;     // of the content-locked bias, over the hue circle and the range of L*
constexpr double kDegree = std::numbers::pi / 180;

/// What one answer is disturbed by, apart from the bias.
struct Disturbance {
  double turn = 0;   ///< radians
  float chroma = 1;  ///< factor
  Ab cast;           ///< added

  Disturbance(const SimulationOptions& options, std::uint64_t query) {
    const CounterRng rng(std::uint64_t(options.seed) ^ named_stream("simul"), query);
    turn = options.hue * (2.0 * double(rng.uniform(0)) - 1.0) * kDegree;
    chroma = 1.0f - float(options.desaturate) * rng.uniform(1);
    if (double(rng.uniform(2)) < options.modes) {
      chroma *= kSecondModeChroma;
      cast = kBrown;
    }
    if (double(rng.uniform(3)) < options.outliers) {
      turn = (90.0 + 180.0 * double(rng.uniform(4))) * kDegree;
      const double hue = 2 * std::numbers::pi * double(rng.uniform(5));
      cast = {kCastChroma * float(std::cos(hue)), kCastChroma * float(std::sin(hue))};
    }
  }
};

/// ab of a view, [2, H, W].
struct TrueColors {
  int width = 0, height = 0;
  std::vector<float> ab;
};

TrueColors true_colors(const View& view) {
  const std::optional<ColorImage> truth = load_color_truth(view);
  if (!truth) {
    throw InputError(view.image_file, "colour", "a simulated colorizer needs colour pictures, and this one is grey");
  }
  const double factor = std::min(1.0, double(kTruthSide) / std::min(truth->width, truth->height));
  const cv::Mat full(truth->height, truth->width, CV_32FC3, const_cast<float*>(truth->rgb.data()));
  cv::Mat small;
  cv::resize(full, small, {}, factor, factor, cv::INTER_AREA);
  TrueColors colors{small.cols, small.rows, std::vector<float>(2 * small.total())};
  for (std::size_t i = 0; i < small.total(); ++i) {
    const cv::Vec3f& rgb = small.at<cv::Vec3f>(int(i) / small.cols, int(i) % small.cols);
    const Lab<float> lab = lab_from_linear_rgb(Vec3f{rgb[0], rgb[1], rgb[2]});
    colors.ab[i] = lab.a;
    colors.ab[small.total() + i] = lab.b;
  }
  return colors;
}

/// A rectangle of a [H, W] channel, resized to the question's size.
std::vector<float> resized_part(const float* channel, const TrueColors& colors, const PatchOrigin& origin,
                                const LightnessBatch& question) {
  const cv::Mat whole(colors.height, colors.width, CV_32F, const_cast<float*>(channel));
  // The affine map from the question's pixels to those of the truth, centres at +0.5; averaged where it shrinks.
  const double sx = origin.width * colors.width / question.width;
  const double sy = origin.height * colors.height / question.height;
  cv::Mat smooth = whole;
  const double blur_x = 0.5 * std::max(0.0, sx - 1), blur_y = 0.5 * std::max(0.0, sy - 1);
  if (blur_x > 0 || blur_y > 0) {
    cv::GaussianBlur(whole, smooth, {}, std::max(blur_x, 0.01), std::max(blur_y, 0.01), cv::BORDER_REPLICATE);
  }
  const cv::Mat map = (cv::Mat_<double>(2, 3) << sx, 0, origin.left * colors.width + 0.5 * sx - 0.5, 0, sy,
                       origin.top * colors.height + 0.5 * sy - 0.5);
  std::vector<float> values(std::size_t(question.height) * std::size_t(question.width));
  cv::Mat out(question.height, question.width, CV_32F, values.data());
  cv::warpAffine(smooth, out, map, out.size(), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
  return values;
}

class SimulatedColorizer final : public Colorizer {
 public:
  SimulatedColorizer(const Capture& capture, const SimulationOptions& options) : options_(options) {
    for (const View& view : capture.views) {
      if (!view.held_out) views_.emplace(view.name, true_colors(view));
    }
  }

  ChromaBatch colorize(const LightnessBatch& patches) override {
    if (patches.origins.size() != std::size_t(patches.batch)) {
      throw ColorizerError(name() + ": colours views of its capture only, and was not told where a patch comes from");
    }
    const std::size_t pixels = std::size_t(patches.height) * std::size_t(patches.width);
    ChromaBatch answer{
        patches.batch, patches.height, patches.width, std::vector<float>(2 * patches.lightness.size()), {}};
    parallel_tasks(patches.origins.size(), [&](std::size_t i) {
      colorize_one(patches, patches.origins[i], std::span(patches.lightness).subspan(i * pixels, pixels),
                   std::span(answer.ab).subspan(2 * i * pixels, 2 * pixels));
    });
    return answer;
  }

  [[nodiscard]] std::string name() const override { return "simulated"; }

 private:
  void colorize_one(const LightnessBatch& patches, const PatchOrigin& origin, std::span<const float> lightness,
                    std::span<float> ab) const {
    const auto found = views_.find(origin.view);
    if (found == views_.end()) throw ColorizerError(name() + ": no training view is called " + origin.view);
    const TrueColors& truth = found->second;
    const std::vector<float> a = resized_part(truth.ab.data(), truth, origin, patches);
    const std::vector<float> b = resized_part(truth.ab.data() + truth.ab.size() / 2, truth, origin, patches);
    const Disturbance disturbance(options_, origin.query);
    for (std::size_t p = 0; p < a.size(); ++p) {
      const float turn = float(disturbance.turn) + bias(a[p], b[p], lightness[p]);
      const float cos = std::cos(turn), sin = std::sin(turn);
      ab[p] = disturbance.chroma * (cos * a[p] - sin * b[p]) + disturbance.cast.a;
      ab[a.size() + p] = disturbance.chroma * (sin * a[p] + cos * b[p]) + disturbance.cast.b;
    }
  }

  /// The same for the same thing in every view, so no averaging removes it.
  [[nodiscard]] float bias(float a, float b, float lightness) const {
    if (options_.bias <= 0) return 0;
    constexpr float kTurn = 2 * std::numbers::pi_v<float>;
    const float phase = kTurn * CounterRng(std::uint64_t(options_.seed), named_stream("bias")).uniform(0);
    const float along_lightness = kTurn / kBiasPeriod * lightness / 100;
    return float(options_.bias * kDegree) * std::sin(std::atan2(b, a) + along_lightness + phase);
  }

  SimulationOptions options_;
  std::map<std::string, TrueColors> views_;
};

}  // namespace

std::unique_ptr<Colorizer> make_simulated_colorizer(const Capture& capture, const SimulationOptions& options) {
  return std::make_unique<SimulatedColorizer>(capture, options);
}

}  // namespace cnerf::compare
