// The engines of stage 2 on random pixels.

#include <gtest/gtest.h>

#include <memory>
#include <numeric>
#include <thread>
#include <utility>

#include "src/base/rng.h"
#include "tests/engine/backend_ops.h"
#include "tests/engine/threads_exchange.h"
#include "tests/support/engine_state.h"
#include "tests/support/random_pixels.h"

namespace cnerf::test {
namespace {

HashGridOptions grid_of(int levels) {
  return {.levels = levels, .log2_rows = 12, .coarsest_resolution = 4, .finest_resolution = 128};
}

std::vector<float> random_weights(int count) {
  SequentialRng rng(4, 1);
  std::vector<float> weights;
  for (int p = 0; p < count; ++p) weights.push_back(rng.uniform(0.0f, 2.0f));
  weights.front() = 0;
  return weights;
}

/// Gradients of a step, then what some steps make of the parameters.
///
/// The steps go on with the moments of the training before them. From moments of zero, Adam moves every parameter by
/// its whole step size along the sign of its gradient, and where a gradient is hardly more than rounding that sign is
/// chance.
/// @param trained  makes a trained engine
/// @param step     (engine, learning rate) -> loss
template <typename Trained, typename Step>
void append_steps(Trained&& trained, Step&& step, std::vector<Result>& results) {
  const auto forgetful = trained();
  forget_moments(*forgetful);
  results.push_back({"loss", {step(*forgetful, 1e-9f)}});
  for (const StatePiece& piece : forgetful->state()) {
    if (!piece.name.ends_with("first_moments") && !piece.name.ends_with("grid.moments")) continue;
    results.push_back({"gradient: " + piece.name, doubles(gradient_in(forgetful->state(), piece.name))});
  }
  const auto engine = trained();
  for (int i = 0; i < 4; ++i) step(*engine, 1e-3f);
  for (const StatePiece& piece : engine->state()) {
    if (!piece.name.ends_with("steps")) results.push_back({"after steps: " + piece.name, doubles(floats_of(piece))});
  }
}
/// @param nets  by name; the grid is the first one's
void append_bounds(const std::string& grid, const std::vector<std::string>& nets, double gradient, Op& op) {
  op.bounds.push_back({"loss", 1e-4, 1e-3});
  op.bounds.push_back({"gradient: " + grid + ".moments", 1e-3, gradient, Measure::kGradient});
  for (const std::string& net : nets) {
    op.bounds.push_back({"gradient: " + net + ".first_moments", 1e-3, gradient, Measure::kGradient});
  }
  op.bounds.push_back({"after steps: " + grid + ".table", 2e-3, 2e-3});
  op.bounds.push_back({"after steps: " + grid + ".moments", 2e-2, 2e-2});
  for (const std::string& net : nets) {
    op.bounds.push_back({"after steps: " + net + ".weights", 2e-3, 2e-3});
    op.bounds.push_back({"after steps: " + net + ".first_moments", 2e-2, 2e-2});
    op.bounds.push_back({"after steps: " + net + ".second_moments", 2e-2, 2e-2});
  }
}

struct BinProblem {
  const char* name;
  int levels, count;
  ChromaLossWeights more;
};

class BinScene {
 public:
  explicit BinScene(const BinProblem& problem)
      : problem_(problem), pixels_(random_pixels(problem.count, 24, 3)), weights_(random_weights(problem.count)) {
    for (const Ab& color : colors_of(pixels_)) labels_.push_back(soft_label(color));
  }
  double step(ColorBinEngine& engine, float rate) const {
    return engine.step(pixels_, labels_, weights_, problem_.more, rate);
  }
  [[nodiscard]] std::unique_ptr<ColorBinEngine> fresh(const Backend& backend) const {
    return backend.make([&](const Engines& engines) { return engines.make_color_bins(grid_of(problem_.levels), 5); });
  }
  [[nodiscard]] std::unique_ptr<ColorBinEngine> trained(const Backend& backend) {
    if (!trainer_) trainer_ = fresh(reference_backend());
    while (trainer_->step_count() < 30) step(*trainer_, 1e-2f);
    auto engine = fresh(backend);
    copy_state(*trainer_, *engine);
    return engine;
  }
  /// Without what all logits of a pixel have in common, which a softmax does not see.
  [[nodiscard]] std::vector<double> logits(const ColorBinEngine& engine) const {
    std::vector<float> logits(pixels_.pixels() * kAbBinCount);
    engine.logits(pixels_, logits);
    std::vector<double> centred = doubles(logits);
    for (auto pixel = centred.begin(); pixel != centred.end(); pixel += kAbBinCount) {
      const double mean = std::accumulate(pixel, pixel + kAbBinCount, 0.0) / kAbBinCount;
      for (auto logit = pixel; logit != pixel + kAbBinCount; ++logit) *logit -= mean;
    }
    return centred;
  }
  /// Of pixels that have a colour.
  [[nodiscard]] std::vector<double> colors(const ColorBinEngine& engine, float temperature) const {
    std::vector<Ab> decoded(pixels_.pixels());
    engine.decode(pixels_, temperature, decoded);
    std::vector<double> colors;
    for (std::size_t p = 0; p < decoded.size(); ++p) {
      if (pixels_.opacity(p) >= kLeastColoredOpacity) colors.insert(colors.end(), {decoded[p].a, decoded[p].b});
    }
    return colors;
  }

 private:
  BinProblem problem_;
  PixelSamples pixels_;
  std::vector<float> weights_;
  std::vector<SoftLabel> labels_;
  std::unique_ptr<ColorBinEngine> trainer_;
};

Op color_bins(const BinProblem& problem) {
  const auto scene = std::make_shared<BinScene>(problem);
  Op op;
  op.name = problem.name;
  op.run = [scene](const Backend& backend) {
    const auto engine = scene->trained(backend);
    std::vector<Result> results = {{"logits at the start", scene->logits(*scene->fresh(backend))},
                                   {"logits after training", scene->logits(*engine)},
                                   {"annealed mean", scene->colors(*engine, 0.38f)},
                                   {"most probable bin", scene->colors(*engine, 0)}};
    append_steps([&] { return scene->trained(backend); },
                 [&](ColorBinEngine& e, float rate) { return scene->step(e, rate); }, results);
    return results;
  };
  // Two bins may be equally probable but for rounding.
  op.bounds = {{"logits at the start", 1e-4, 1e-3},
               {"logits after training", 1e-4, 1e-3},
               {"annealed mean", 1e-2, 0.1, Measure::kPercentile99},
               {"most probable bin", 1e-3, 1e-3, Measure::kPercentile99}};
  // The spread is a matter of differences of features, which are rounded to half precision.
  append_bounds("features.grid", {"features.net", "head"}, problem.more.spread > 1 ? 5e-2 : 2e-2, op);
  return op;
}

struct FieldProblem {
  const char* name;
  int levels, count;
  AbLoss loss;
};

Op color_field(const FieldProblem& problem) {
  const PixelSamples pixels = random_pixels(problem.count, 24, 3);
  const std::vector<Ab> targets = colors_of(pixels);
  const std::vector<float> weights = problem.count > 1 ? random_weights(problem.count) : std::vector<float>{1};
  // Where targets are met a gradient is what rounding leaves; so gradients are compared away from them.
  std::vector<Ab> moved = targets;
  for (Ab& color : moved) color = {color.a + 12, color.b - 9};
  const auto fresh = [problem](const Backend& backend) {
    return backend.make([&](const Engines& engines) { return engines.make_color_field(grid_of(problem.levels), 5); });
  };
  const auto trainer = std::make_shared<std::unique_ptr<ColorFieldEngine>>();
  Op op;
  op.name = problem.name;
  op.run = [=](const Backend& backend) {
    if (!*trainer) {
      *trainer = fresh(reference_backend());
      for (int i = 0; i < 100; ++i) (*trainer)->step(pixels, targets, weights, problem.loss, 1e-2f);
    }
    const auto trained = [&] {
      auto engine = fresh(backend);
      copy_state(**trainer, *engine);
      return engine;
    };
    const auto engine = trained();
    std::vector<Ab> composited(pixels.pixels());
    engine->composite(pixels, composited);
    std::vector<Chromaticity> ratios(pixels.positions.size());
    engine->query(pixels.positions, ratios);
    std::vector<Result> results = {{"composited colours", {}}, {"chromaticity of points", {}}};
    for (const Ab& color : composited) results[0].values.insert(results[0].values.end(), {color.a, color.b});
    for (const Chromaticity& ratio : ratios) results[1].values.insert(results[1].values.end(), {ratio.x, ratio.z});
    append_steps(
        trained, [&](ColorFieldEngine& e, float rate) { return e.step(pixels, moved, weights, problem.loss, rate); },
        results);
    return results;
  };
  op.bounds = {{"composited colours", 1e-3, 5e-3}, {"chromaticity of points", 1e-4, 4e-3}};
  append_bounds("chromaticity.grid", {"chromaticity.net"}, 2e-2, op);
  return op;
}

/// Engines that share steps learn what one learns that has them alone, and stay equal.
/// @param trained  makes a trained engine of a back end
/// @param step     (engine, learning rate) -> loss
template <typename Trained, typename Step>
Op shared(Op op, const char* name, const Trained& trained, const Step& step) {
  op.name = name;
  std::erase_if(op.bounds, [](const Bound& bound) {
    return bound.result != "loss" && !bound.result.starts_with("gradient") && !bound.result.starts_with("after");
  });
  op.expected = [=] {
    std::vector<Result> results;
    append_steps([&] { return trained(reference_backend()); }, step, results);
    return results;
  };
  op.run = [=](const Backend& backend) {
    constexpr int kParts = 3;
    ThreadsExchange exchange(kParts);
    std::vector<decltype(trained(backend))> engines;  // made here: which kernels they use is a matter of the process
    for (int i = 0; i < 2 * kParts; ++i) engines.push_back(trained(backend));
    std::vector<std::vector<Result>> results{std::size_t(kParts), std::vector<Result>()};
    std::vector<std::jthread> threads;
    for (int part = 0; part < kParts; ++part) {
      threads.emplace_back([&, part] {
        std::size_t next = std::size_t(part);
        const auto own = [&] {
          auto engine = std::move(engines[std::exchange(next, next + kParts)]);
          engine->share_steps(exchange.share(part));
          return engine;
        };
        append_steps(own, step, results[std::size_t(part)]);
      });
    }
    threads.clear();
    for (std::size_t i = 0; i < results[0].size(); ++i) {
      for (std::size_t part = 1; part < kParts; ++part) EXPECT_EQ(results[part][i].values, results[0][i].values);
    }
    return results[0];
  };
  return op;
}

Op shared_color_bins(const BinProblem& problem) {
  const auto scene = std::make_shared<BinScene>(problem);
  return shared(
      color_bins(problem), problem.name, [=](const Backend& backend) { return scene->trained(backend); },
      [=](ColorBinEngine& engine, float rate) { return scene->step(engine, rate); });
}

Op shared_color_field(const FieldProblem& problem) {
  const PixelSamples pixels = random_pixels(problem.count, 24, 3);
  const std::vector<Ab> targets = colors_of(pixels);
  const std::vector<float> weights = random_weights(problem.count);
  const auto trainer = std::make_shared<std::unique_ptr<ColorFieldEngine>>();
  const auto trained = [=](const Backend& backend) {
    const auto make_on = [&](const Backend& on) {
      return on.make([&](const Engines& engines) { return engines.make_color_field(grid_of(problem.levels), 5); });
    };
    if (!*trainer) {
      *trainer = make_on(reference_backend());
      for (int i = 0; i < 10; ++i) (*trainer)->step(pixels, targets, weights, problem.loss, 1e-2f);
    }
    auto engine = make_on(backend);
    copy_state(**trainer, *engine);
    return engine;
  };
  return shared(color_field(problem), problem.name, trained, [=](ColorFieldEngine& engine, float rate) {
    return engine.step(pixels, targets, weights, problem.loss, rate);
  });
}

/// Losses after training from the same start.
Op color_learning() {
  const auto bins = std::make_shared<BinScene>(BinProblem{"", 8, 777, {}});
  const PixelSamples pixels = random_pixels(777, 24, 3);
  const std::vector<Ab> targets = colors_of(pixels);
  Op op;
  op.name = "ColorsAreLearnt";
  op.is_gpu_only = true;
  op.run = [=](const Backend& backend) -> std::vector<Result> {
    const auto engine = bins->fresh(backend);
    const double first = bins->step(*engine, 1e-2f);
    double last = 0, distance = 0;
    for (int i = 0; i < 150; ++i) last = bins->step(*engine, 1e-2f);
    EXPECT_LT(last, 0.5 * first);
    const auto field = backend.engines().make_color_field(grid_of(8), 6);
    for (int i = 0; i < 300; ++i) distance = field->step(pixels, targets, {}, AbLoss::kHuber, i < 200 ? 1e-2f : 1e-3f);
    const auto processor = bins->fresh(reference_backend());  // reads what the back end trained
    copy_state(*engine, *processor);
    return {{"loss after 150 steps", {last}},
            {"ab distance after 300 steps", {distance}},
            {"snapshot", {relative_distance(bins->logits(*processor), bins->logits(*engine)) < 1e-3 ? 1.0 : 0.0}}};
  };
  op.bounds = {{"loss after 150 steps", 0, 0.1},
               {"ab distance after 300 steps", 0, 0.2, Measure::kPercentile99},
               {"snapshot", 0, 0}};
  return op;
}

/// Pixels without samples, or none that count, are no error and change nothing of the hash grid; nor is a step of no
/// pixels at all.
Op empty_pixels() {
  Op op;
  op.name = "PixelsWithoutSamples";
  op.run = [](const Backend& backend) -> std::vector<Result> {
    PixelSamples pixels;
    pixels.offsets.assign(18, 0);
    const auto engine = backend.make([&](const Engines& engines) { return engines.make_color_bins(grid_of(3), 5); });
    const double loss = engine->step(pixels, std::vector<SoftLabel>(17, soft_label({20, 20})), {}, {}, 1e-2f);
    const auto field = backend.make([&](const Engines& engines) { return engines.make_color_field(grid_of(3), 5); });
    std::vector<Ab> colors(17);
    field->composite(pixels, colors);
    const PixelSamples none;
    const double idle = engine->step(none, {}, {}, {}, 1e-2f) + field->step(none, {}, {}, AbLoss::kHuber, 1e-2f);
    return {{"loss", {loss}},
            {"colour", {1 + colors[3].a, 1 + colors[3].b}},
            {"of no pixels", {idle, double(engine->step_count()), double(field->step_count())}}};
  };
  op.expected = []() -> std::vector<Result> {
    return {{"loss", {std::log(313.0)}}, {"colour", {1, 1}}, {"of no pixels", {0, 2, 1}}};
  };
  op.bounds = {{"loss", 0.3, 0.3}, {"colour", 1e-6, 1e-6}, {"of no pixels", 0, 0}};
  return op;
}

}  // namespace

std::vector<Op> color_ops() {
  return {color_bins({"ColorBins", 8, 777, {}}),
          color_bins({"ColorBinsWithSpread", 8, 777, {.spread = 3}}),
          color_bins({"ColorBinsWithRegression", 8, 777, {.regression = 0.3f}}),
          color_bins({"ColorBinsOfFewLevels", 3, 16, {}}),
          color_bins({"ColorBinsOfManyLevels", 16, 1024, {0.3f, 0.1f}}),
          color_field({"ColorField", 8, 777, AbLoss::kHuber}),
          color_field({"ColorFieldOfOnePixel", 3, 1, AbLoss::kSquared}),
          color_field({"ColorFieldOfManyLevels", 13, 3000, AbLoss::kSquared}),
          shared_color_bins({"ColorBinsShared", 8, 777, {0.3f, 0.1f}}),
          shared_color_field({"ColorFieldShared", 8, 777, AbLoss::kHuber}),
          color_learning(),
          empty_pixels()};
}

}  // namespace cnerf::test
