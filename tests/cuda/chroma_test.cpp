// Stage 2's engines against the CPU's, on random pixels. Bounds are two to ten times what was seen on an H200
// (docs/performance.md); what is seen comes from rounding to 16 bits, as in self_test.cpp.

#include "src/engine/color_engines.h"

#include <cstring>
#include <numeric>

#include "src/base/rng.h"
#include "src/optim/adam.h"
#include "tests/cuda/check.h"
#include "tests/cuda/expect.h"
#include "tests/cuda/random_pixels.h"

namespace cnerf::test {
namespace {

/// A gradient, seen through Adam: the first moments after a step from moments of zero are a tenth of it.
/// @param name  of the engine's state piece of moments; a hash grid's are [rows, 8], the first ones in front
std::vector<float> gradient_in(const std::vector<StatePiece>& state, const std::string& name) {
  constexpr float kShare = 1 - kAdamBeta1;
  std::vector<float> gradient;
  for (const StatePiece& piece : state) {
    if (piece.name != name) continue;
    const bool is_grid = name.ends_with("grid.moments");
    const std::span<const float> moments = floats_of(piece);
    for (std::size_t i = 0; i < moments.size(); ++i) {
      if (!is_grid || i % 8 < 4) gradient.push_back(moments[i] / kShare);
    }
  }
  return gradient;
}

template <typename Engine>
void forget_moments(Engine& engine) {
  for (const StatePiece& piece : engine.state()) {
    if (piece.name.find("moments") != std::string::npos) std::memset(piece.bytes.data(), 0, piece.bytes.size());
  }
  engine.state_loaded();
}

/// Compares the gradients of one step, then what some steps make of the parameters.
/// @param step  (engine, learning rate) -> loss
template <typename Engine, typename Step>
void compare_steps(Engine& cpu, Engine& cuda, Step&& step, double gradient_bound = 2e-2) {
  forget_moments(cpu);
  copy_state(cpu, cuda);
  const double expected_loss = step(cpu, 1e-9f), loss = step(cuda, 1e-9f);
  expect_below("loss", std::abs(loss - expected_loss) / expected_loss, 1e-3);
  const std::vector<StatePiece> expected = cpu.state(), found = cuda.state();
  for (const StatePiece& piece : expected) {
    const std::string& name = piece.name;
    if (!name.ends_with("first_moments") && !name.ends_with("grid.moments")) continue;
    expect_gradient("gradient: " + name, gradient_in(found, name), gradient_in(expected, name), gradient_bound);
  }

  for (int i = 0; i < 4; ++i) step(cpu, 1e-3f), step(cuda, 1e-3f);
  const std::vector<StatePiece> of_cpu = cpu.state(), of_cuda = cuda.state();
  for (std::size_t i = 0; i < of_cpu.size(); ++i) {
    if (of_cpu[i].name.ends_with("steps")) continue;
    const bool is_moment = of_cpu[i].name.find("moments") != std::string::npos;
    expect_below("after steps: " + of_cpu[i].name, relative_distance(floats_of(of_cuda[i]), floats_of(of_cpu[i])),
                 is_moment ? 2e-2 : 2e-3);
  }
}

HashGridOptions grid_of(int levels) {
  return {.levels = levels, .log2_rows = 12, .coarsest_resolution = 4, .finest_resolution = 128};
}

void check_distribution(int levels, int count, const ChromaLossWeights& more, bool quick) {
  std::printf("-- distribution: %d levels, %d pixels, spread weight %g, regression weight %g\n", levels, count,
              double(more.spread), double(more.regression));
  const PixelSamples pixels = random_pixels(count, 24, 3);
  const std::vector<Ab> colors = colors_of(pixels);
  std::vector<SoftLabel> labels;
  std::vector<float> weights;
  SequentialRng rng(4, 1);
  for (const Ab& color : colors) {
    labels.push_back(soft_label(color));
    weights.push_back(rng.uniform(0.0f, 2.0f));
  }
  weights.front() = 0;
  const auto cpu = make_cpu_color_bin_engine(grid_of(levels), 5), cuda = make_cuda_color_bin_engine(grid_of(levels), 5);
  const auto step = [&](ColorBinEngine& engine, float rate) {
    return engine.step(pixels, labels, weights, more, rate);
  };

  const auto compare_logits = [&](const char* what, double bound) {
    std::vector<float> expected(std::size_t(count) * kAbBinCount), found(expected.size());
    cpu->logits(pixels, expected);
    cuda->logits(pixels, found);
    // A softmax does not see what all logits of a pixel have in common.
    for (auto* logits : {&expected, &found}) {
      for (std::size_t p = 0; p < std::size_t(count); ++p) {
        float mean = 0;
        for (int q = 0; q < kAbBinCount; ++q) mean += (*logits)[p * kAbBinCount + std::size_t(q)] / kAbBinCount;
        for (int q = 0; q < kAbBinCount; ++q) (*logits)[p * kAbBinCount + std::size_t(q)] -= mean;
      }
    }
    expect_below(what, relative_distance(found, expected), bound);
  };
  const auto compare_colors = [&](const char* what, float temperature, double bound) {
    std::vector<Ab> expected(std::size_t(count)), found(expected.size());
    cpu->decode(pixels, temperature, expected);
    cuda->decode(pixels, temperature, found);
    std::vector<double> distances;
    for (std::size_t p = 0; p < found.size(); ++p) {
      const auto begin = pixels.weights.begin();
      const float opacity = std::accumulate(begin + std::ptrdiff_t(pixels.offsets[p]),
                                            begin + std::ptrdiff_t(pixels.offsets[p + 1]), 0.0f);
      if (opacity < kLeastColoredOpacity) continue;  // its logits mean nothing
      distances.push_back(std::hypot(found[p].a - expected[p].a, found[p].b - expected[p].b));
    }
    // Two bins may be equally probable but for rounding: hence not the furthest, but the 99th percentile.
    const auto rank = distances.begin() + std::ptrdiff_t(distances.size() * 99 / 100);
    std::nth_element(distances.begin(), rank, distances.end());
    expect_below(what, *rank, bound);
  };
  compare_logits("logits at the start", 1e-3);
  for (int i = 0; i < 30; ++i) step(*cpu, 1e-2f);
  copy_state(*cpu, *cuda);
  compare_logits("logits after training", 1e-3);
  compare_colors("annealed mean, ab distance", 0.38f, 0.1);
  compare_colors("most probable bin, ab distance", 0, 1e-3);
  // The spread is a matter of differences of features, which are rounded to half precision.
  compare_steps(*cpu, *cuda, step, more.spread > 1 ? 5e-2 : 2e-2);
  if (quick) return;

  const auto fresh_cpu = make_cpu_color_bin_engine(grid_of(levels), 6);
  const auto fresh = make_cuda_color_bin_engine(grid_of(levels), 6);
  const double first = step(*fresh, 1e-2f);
  step(*fresh_cpu, 1e-2f);
  double last = 0, of_cpu = 0;
  for (int i = 0; i < 150; ++i) last = step(*fresh, 1e-2f), of_cpu = step(*fresh_cpu, 1e-2f);
  expect_below("loss after 150 steps / first loss", last / first, 0.5);
  expect_below("loss after 150 steps / the CPU's", last / of_cpu, 1.1);
  copy_state(*fresh, *cpu);  // and back
  copy_state(*fresh, *cuda);
  compare_logits("logits of what the GPU trained, on the CPU", 1e-3);
}

void check_chromaticity(int levels, int count, AbLoss loss, bool quick) {
  std::printf("-- chromaticity: %d levels, %d pixels\n", levels, count);
  const PixelSamples pixels = random_pixels(count, 24, 3);
  const std::vector<Ab> targets = colors_of(pixels);
  std::vector<float> weights;
  SequentialRng rng(4, 2);
  for (int p = 0; p < count; ++p) weights.push_back(rng.uniform(0.0f, 2.0f));
  const auto cpu = make_cpu_color_field_engine(grid_of(levels), 5);
  const auto cuda = make_cuda_color_field_engine(grid_of(levels), 5);
  const auto step = [&](ColorFieldEngine& engine, float rate) {
    return engine.step(pixels, targets, weights, loss, rate);
  };
  // Where targets are met a gradient is what rounding leaves; so gradients are compared away from them.
  std::vector<Ab> moved = targets;
  for (Ab& color : moved) color = {color.a + 12, color.b - 9};
  const auto step_to_moved = [&](ColorFieldEngine& engine, float rate) {
    return engine.step(pixels, moved, weights, loss, rate);
  };
  for (int i = 0; i < 100; ++i) step(*cpu, 1e-2f);
  copy_state(*cpu, *cuda);

  std::vector<Ab> expected(std::size_t(count)), found(expected.size());
  cpu->composite(pixels, expected);
  cuda->composite(pixels, found);
  double furthest = 0;
  for (std::size_t p = 0; p < found.size(); ++p) {
    furthest = std::max(furthest, double(std::hypot(found[p].a - expected[p].a, found[p].b - expected[p].b)));
  }
  expect_below("composited colours, largest ab distance", furthest, 0.15);
  std::vector<Chromaticity> ratios(pixels.positions.size()), of_cpu(ratios.size());
  cpu->query(pixels.positions, of_cpu);
  cuda->query(pixels.positions, ratios);
  furthest = 0;
  for (std::size_t i = 0; i < ratios.size(); ++i) {
    furthest = std::max(
        {furthest, double(std::abs(ratios[i].x / of_cpu[i].x - 1)), double(std::abs(ratios[i].z / of_cpu[i].z - 1))});
  }
  expect_below("chromaticity of points, largest relative distance", furthest, 4e-3);
  compare_steps(*cpu, *cuda, step_to_moved);
  if (quick) return;

  const auto fresh = make_cuda_color_field_engine(grid_of(levels), 6);
  const auto fresh_cpu = make_cpu_color_field_engine(grid_of(levels), 6);
  double last = 0, of_same = 0;
  for (int i = 0; i < 300; ++i) {
    const float rate = i < 200 ? 1e-2f : 1e-3f;
    last = step(*fresh, rate), of_same = step(*fresh_cpu, rate);
  }
  expect_below("ab distance after 300 steps, above the CPU's", last - of_same, 0.2);
}

/// Pixels without samples, or none that count, are no error and change nothing of the hash grid.
void check_empty_pixels() {
  PixelSamples pixels;
  pixels.offsets.assign(18, 0);
  const auto engine = make_cuda_color_bin_engine(grid_of(3), 5);
  const double loss = engine->step(pixels, std::vector<SoftLabel>(17, soft_label({20, 20})), {}, 1e-2f);
  expect_below("loss of pixels without samples: away from uniform", std::abs(loss / std::log(313.0) - 1), 0.3);
  const auto field = make_cuda_color_field_engine(grid_of(3), 5);
  std::vector<Ab> colors(17);
  field->composite(pixels, colors);
  expect_below("colour of pixels without samples", std::hypot(colors[3].a, colors[3].b), 1e-6);
}

}  // namespace

void check_chroma(bool quick) {
  check_distribution(8, 777, {}, quick);
  check_distribution(8, 777, {.spread = 3}, quick);
  check_distribution(8, 777, {.regression = 0.3f}, quick);
  check_chromaticity(8, 777, AbLoss::kHuber, quick);
  if (!quick) {
    check_distribution(3, 16, {}, quick);
    check_distribution(16, 4096, {0.3f, 0.1f}, quick);
    check_chromaticity(3, 1, AbLoss::kSquared, quick);
    check_chromaticity(13, 3000, AbLoss::kSquared, quick);
  }
  check_empty_pixels();
}

}  // namespace cnerf::test
