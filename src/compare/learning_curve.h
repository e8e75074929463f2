#pragma once
/// How well a field does on pixels it is not trained on, while it trains: what "trains faster" means in numbers.

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/base/observer.h"
#include "src/base/usage.h"
#include "src/capture/capture.h"
#include "src/engine/color_engines.h"
#include "src/engine/engines.h"
#include "src/field/scene_frame.h"
#include "src/render/direction_map.h"

namespace cnerf::compare {

/// A measurement after some training.
struct LearningPoint {
  double seconds = 0;  ///< of training; measuring does not count
  double value = 0;    ///< dB or ab units

  // As JSON: [seconds, value].
  friend void to_json(auto& json, const LearningPoint& point) { json = {point.seconds, point.value}; }
  friend void from_json(const auto& json, LearningPoint& point) {
    json.at(0).get_to(point.seconds);
    json.at(1).get_to(point.value);
  }
};

/// When a curve first gets as good as `wanted`, between its points linearly; nothing where it never does.
/// @param better  1: higher is better, -1: lower is
[[nodiscard]] std::optional<double> seconds_to(std::span<const LearningPoint> curve, double wanted, int better);
/// A curve's value at a time, between its points linearly; its first or last value outside.
/// @param curve  not empty
[[nodiscard]] double value_at(std::span<const LearningPoint> curve, double seconds);

/// Some pixels of the evaluated views, the same for every field, with what they should show.
class HeldOutPixels {
 public:
  /// @param views  of which `count` pixels are drawn in all; masked ones are left out
  HeldOutPixels(std::span<const View* const> views, const SceneFrame& frame, std::size_t count);

  /// PSNR of sRGB-encoded luminance over all the pixels at once, dB. A view's PSNR is the mean of its own dB, so this
  /// differs from a table's by some tenths.
  /// @param sky  behind the field; without values there is none
  [[nodiscard]] double psnr(const LuminanceEngine& engine, const MarchSettings& march,
                            const DirectionView& sky = {}) const;

  /// Keeps what the rays of the pixels meet, for `ab_error`.  @param sky  as in `psnr`
  void trace(const LuminanceEngine& engine, const MarchSettings& march, const DirectionView& sky = {});
  /// Mean ab distance of the decoded colours to the true ones, where these are known and more of the field is seen than
  /// of a sky.
  /// @param temperature  of the decoding
  /// @throws InputError  there is no such pixel
  [[nodiscard]] double ab_error(const ColorBinEngine& engine, float temperature) const;

 private:
  std::vector<Ray> rays_;
  std::vector<float> luminance_;           // linear, over black
  std::vector<std::optional<Ab>> colors_;  // none where a view has none
  PixelSamples samples_;
  bool has_sky_ = false;  // behind them
};

/// Measures at times that grow by a factor, and for no longer than there is training.
class LearningCurve final : public Observer {
 public:
  /// Passes on to `inner` and measures between steps of `task`; the clock stands still before that task and while it
  /// measures.
  LearningCurve(std::string task, Observer& inner, std::function<double()> measure)
      : task_(std::move(task)), inner_(inner), measure_(std::move(measure)) {}
  void report_progress(const Progress& progress) override;
  void say(const std::string& text) override { inner_.say(text); }
  void wrote(const std::string& what, const std::filesystem::path& path) override { inner_.wrote(what, path); }
  [[nodiscard]] bool is_cancelled() const override { return inner_.is_cancelled(); }
  /// Training time up to the last step.
  [[nodiscard]] double seconds() const { return last_; }
  [[nodiscard]] const std::vector<LearningPoint>& points() const { return points_; }

 private:
  void measure(double now);

  std::string task_;
  Observer& inner_;
  std::function<double()> measure_;
  std::vector<LearningPoint> points_;
  std::optional<Stopwatch> clock_;
  double paused_ = 0;  // seconds of the clock that were no training
  double last_ = 0, next_ = 0;
};

}  // namespace cnerf::compare
