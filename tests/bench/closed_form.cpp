// Are colours by weighted least squares ahead of gradient descent on the same answers?
//   cnerf-closed-form RUN [colorizer=simulated|builtin] [answers=25,50,100,200]
// RUN is a trained run whose capture has colours. Per number of accepted answers: held-out ab error after as many steps
// of stage 2 as configured for that many patches, and of voxels that the same pixels' colours were solved for; with the
// seconds that each took, answers and views left out.

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <optional>

#include "src/base/text.h"
#include "src/base/usage.h"
#include "src/compare/baselines/simulated.h"
#include "src/compare/learning_curve.h"
#include "src/evaluate/evaluate.h"
#include "src/pipeline/colorize_step.h"
#include "src/train/chroma/injection.h"
#include "tests/bench/bench_main.h"

namespace cnerf {
namespace {
namespace fs = std::filesystem;

/// Chroma of voxels of the unit cube at several resolutions, each what the coarser ones leave: so voxels that no pixel
/// shows have their surroundings' colours. Level by level
///
///   min over c of Σ_p w_p |Σ_s W_s c(v_s) / A_p - r_p|² + ridge |c|²,
///
/// r being what is left of the pixels' colours; conjugate gradients on the normal equations.
class VoxelColors final : public ColorBinEngine {
 public:
  void add(const ColoredPixels& pixels) {
    for (std::size_t p = 0; p < pixels.samples.pixels(); ++p) {
      const float opacity = pixels.samples.opacity(p);
      if (opacity < kLeastColoredOpacity) continue;
      for (std::size_t s = pixels.samples.offsets[p]; s < pixels.samples.offsets[p + 1]; ++s) {
        positions_.push_back(pixels.samples.positions[s]);
        shares_.push_back(pixels.samples.weights[s] / opacity);
      }
      offsets_.push_back(positions_.size());
      wanted_.push_back(pixels.colors[p]);
      weights_.push_back(pixels.weights[p]);
    }
  }
  void solve() {
    std::vector<Ab> left = wanted_;
    for (std::size_t level = 0; level < kSides.size(); ++level) {
      std::vector<std::size_t> cells(positions_.size());
      for (std::size_t s = 0; s < cells.size(); ++s) cells[s] = cell(level, positions_[s]);
      for (const auto channel : {&Ab::a, &Ab::b}) {
        std::vector<float>& colors = channel == &Ab::a ? a_[level] : b_[level];
        solve_channel(cells, left, channel, colors);
        const std::vector<double> shown = seen(cells, colors);
        for (std::size_t p = 0; p < left.size(); ++p) left[p].*channel -= float(shown[p]);
      }
    }
  }

  void decode(const PixelSamples& pixels, float /*temperature*/, std::span<Ab> colors) const override {
    for (std::size_t p = 0; p < pixels.pixels(); ++p) {
      const float opacity = std::max(pixels.opacity(p), kLeastColoredOpacity);
      colors[p] = {};
      for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) {
        for (std::size_t level = 0; level < kSides.size(); ++level) {
          const std::size_t at = cell(level, pixels.positions[s]);
          colors[p].a += pixels.weights[s] / opacity * a_[level][at];
          colors[p].b += pixels.weights[s] / opacity * b_[level][at];
        }
      }
    }
  }
  double fit(const PixelSamples&, std::span<const SoftLabel>, std::span<const float>, const ChromaLossWeights&,
             float) override {
    return 0;
  }
  void logits(const PixelSamples&, std::span<float>) const override {}
  [[nodiscard]] std::vector<StatePiece> state() override { return {}; }
  void state_loaded() override {}

 private:
  static constexpr std::array<int, 4> kSides = {8, 32, 64, 128};
  static constexpr int kIterations = 12;
  static constexpr double kRidge = 1;  // pixels' worth of what coarser voxels say

  static std::size_t cell(std::size_t level, const Vec3f& position) {
    const int side = kSides[level];
    const auto index = [&](float x) { return std::size_t(std::clamp(int(x * float(side)), 0, side - 1)); };
    return (index(position.z) * std::size_t(side) + index(position.y)) * std::size_t(side) + index(position.x);
  }
  /// What pixels show of voxels.
  template <typename Values>
  [[nodiscard]] std::vector<double> seen(const std::vector<std::size_t>& cells, const Values& values) const {
    std::vector<double> shown(weights_.size(), 0.0);
    for (std::size_t p = 0; p < shown.size(); ++p) {
      for (std::size_t s = offsets_[p]; s < offsets_[p + 1]; ++s) shown[p] += shares_[s] * values[cells[s]];
    }
    return shown;
  }
  /// The transposed, weighted.
  [[nodiscard]] std::vector<double> spread(const std::vector<std::size_t>& cells, const std::vector<double>& pixels,
                                           std::size_t voxels) const {
    std::vector<double> sums(voxels, 0.0);
    for (std::size_t p = 0; p < pixels.size(); ++p) {
      for (std::size_t s = offsets_[p]; s < offsets_[p + 1]; ++s)
        sums[cells[s]] += weights_[p] * shares_[s] * pixels[p];
    }
    return sums;
  }
  void solve_channel(const std::vector<std::size_t>& cells, const std::vector<Ab>& left, float Ab::*channel,
                     std::vector<float>& colors) const {
    const std::size_t n = colors.size();
    std::vector<double> pixels(left.size()), x(n, 0.0);
    for (std::size_t p = 0; p < left.size(); ++p) pixels[p] = left[p].*channel;
    std::vector<double> residual = spread(cells, pixels, n), direction = residual;
    double size = dot(residual, residual);
    for (int i = 0; i < kIterations && size > 1e-9; ++i) {
      std::vector<double> product = spread(cells, seen(cells, direction), n);
      for (std::size_t v = 0; v < n; ++v) product[v] += kRidge * direction[v];
      const double step = size / dot(direction, product);
      for (std::size_t v = 0; v < n; ++v) {
        x[v] += step * direction[v];
        residual[v] -= step * product[v];
      }
      const double next = dot(residual, residual);
      for (std::size_t v = 0; v < n; ++v) direction[v] = residual[v] + next / size * direction[v];
      size = next;
    }
    std::ranges::transform(x, colors.begin(), [](double value) { return float(value); });
  }
  static double dot(const std::vector<double>& a, const std::vector<double>& b) {
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
  }
  static std::array<std::vector<float>, kSides.size()> grids() {
    std::array<std::vector<float>, kSides.size()> made;
    for (std::size_t i = 0; i < made.size(); ++i) made[i].resize(std::size_t(kSides[i]) * kSides[i] * kSides[i]);
    return made;
  }

  std::vector<Vec3f> positions_;
  std::vector<float> shares_, weights_;
  std::vector<std::size_t> offsets_ = {0};
  std::vector<Ab> wanted_;
  std::array<std::vector<float>, kSides.size()> a_ = grids(), b_ = grids();
};

/// The method's own, with a clock.
struct Descent final : Injection {
  explicit Descent(const Stage2Options& options) : own(options) {}
  [[nodiscard]] PixelColors pixel_colors() const override { return own.pixel_colors(); }
  [[nodiscard]] long step_count(const ColorModel& model) const override { return own.step_count(model); }
  double step(ColorModel& model, const ColoredPixels& pixels, float rate) const override {
    const Stopwatch watch;
    const double loss = own.step(model, pixels, rate);
    seconds += watch.seconds();
    return loss;
  }
  Classification own;
  mutable double seconds = 0;
};

/// Keeps what it is to learn.
struct Gathering final : Injection {
  [[nodiscard]] PixelColors pixel_colors() const override { return PixelColors::kField; }
  [[nodiscard]] long step_count(const ColorModel&) const override { return steps; }
  double step(ColorModel&, const ColoredPixels& pixels, float) const override {
    const Stopwatch watch;
    voxels.add(pixels);
    ++steps;
    seconds += watch.seconds();
    return 0;
  }
  mutable VoxelColors voxels;
  mutable long steps = 0;
  mutable double seconds = 0;
};

struct Bench {
  const pipeline::RunContext& context;
  const Engines& engines;
  const LuminanceModel& luminance;
  compare::HeldOutPixels& pixels;
  ViewCache& views;
  std::string spec;
  fs::path take;

  void train(const Stage2Options& options, const Injection& injection) const {
    Observer observer;
    const auto colorizer = spec == "simulated" ? compare::make_simulated_colorizer(context.capture, {})
                                               : pipeline::colorizer_of(context, observer);
    fs::remove(take);
    const Stage2Job job{.capture = context.capture,
                        .stage1 = context.directory.stage1_snapshot(),
                        .options = options,
                        .colorizer = *colorizer,
                        .known = {},
                        .take = take,
                        .views = &views,
                        .injection = &injection};
    (void)train_stage2(job, engines, observer);
  }
  void row(int answers) const {
    Stage2Options options = context.config.stage2;
    options.patches = answers;
    options.distill_steps = 0;
    const Descent descent(options);
    train(options, descent);
    const ColorModel model = ColorModel::load(take, engines);
    const double by_descent = pixels.ab_error(*model.chroma, float(options.decode_temperature));
    const Gathering gathering;
    train(options, gathering);
    const Stopwatch watch;
    gathering.voxels.solve();
    const double seconds = gathering.seconds + watch.seconds();
    fmt::print("| {} | {:.2f} in {:.1f} s | {:.2f} in {:.1f} s |\n", answers, by_descent, descent.seconds,
               pixels.ab_error(gathering.voxels, 0), seconds);
    std::fflush(stdout);
  }
};

int bench(int argc, char** argv) {
  if (argc < 2) return std::puts("cnerf-closed-form RUN [colorizer=simulated|builtin] [answers=25,50,...]"), 64;
  Observer observer;
  const pipeline::RunDirectory directory = pipeline::RunDirectory::open(argv[1]);
  Config config = directory.config("", observer);
  std::string spec = "simulated", counts = "25,50,100,200";
  for (int i = 2; i < argc; ++i) {
    const std::string word = argv[i];
    if (word.starts_with("colorizer=")) spec = word.substr(10);
    if (word.starts_with("answers=")) counts = word.substr(8);
  }
  config.colorizer.spec = spec;
  const pipeline::RunContext context{
      directory, config, pipeline::read_capture(directory.record().capture, config, observer), {"cnerf-closed-form"}};
  const Engines& engines = engines_for("auto");
  const LuminanceModel luminance = LuminanceModel::load(directory.stage1_snapshot(), engines);
  compare::HeldOutPixels pixels(views_to_evaluate(context.capture, {}), luminance.frame, 20000);
  pixels.trace(*luminance.engine, luminance.march(), luminance.sky_light());
  ViewCache views;
  const Bench rows{
      context, engines, luminance, pixels, views, spec, directory.root() / "closed-form" / "take.snapshot"};
  fmt::print("held-out ab error; grey has {:.2f}\n", pixels.ab_error(VoxelColors(), 0));
  fmt::print("| answers | gradient descent | least squares |\n|---|---|---|\n");
  for (const std::string& count : split(counts, ',')) rows.row(std::stoi(count));
  fs::remove_all(directory.root() / "closed-form");
  return 0;
}

}  // namespace
}  // namespace cnerf

int main(int argc, char** argv) {
  return cnerf::bench_main("cnerf-closed-form", cnerf::bench, argc, argv);
}
