// The engine of stage 1: a step's gradients, queries, pictures, and what a step makes of the parameters.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <thread>

#include "src/base/error.h"
#include "src/base/rng.h"
#include "tests/engine/backend_ops.h"
#include "tests/engine/threads_exchange.h"
#include "tests/support/engine_state.h"
#include "tests/support/toy_capture.h"

#if CNERF_CUDA_ENGINE
#include "src/base/cuda/device_memory.h"
#include "src/engine/cuda/view_rotation.h"
#endif

namespace cnerf::test {
namespace {

struct Problem {
  const char* name;
  int levels, log2_rows, finest, cascades;
  bool with_alpha = false, with_lens = false, with_exposures = false;
  float distortion_weight = 0;
  bool learns_views = false;
  bool with_sky = false;
  float depth_weight = 0;
  int samples_per_step = 8192;
};

/// Views, options, and engines that share a state that the generic processor trained.
class Scene {
 public:
  explicit Scene(const Problem& problem) : capture_(toy_capture(6, 48, 40, problem.with_alpha)) {
    for (std::size_t v = 0; v < capture_.views.size(); ++v) {
      View& view = capture_.views[v];
      if (problem.with_exposures) view.image.exposure = 0.7f + 0.15f * float(v % 5);
      if (!problem.with_lens) continue;
      view.intrinsics.model = LensModel::kOpenCv;
      view.intrinsics.distortion = {-0.1, 0.02, 1e-3, -2e-3, 0, 0, 0, 0};
      view.image.mask.assign(view.image.pixel_count(), 255);
      for (std::size_t i = 0; i < view.image.mask.size(); i += 3) view.image.mask[i] = 0;
    }
    SceneFrame frame;
    frame.unit_per_world = problem.cascades > 1 ? 0.12 : 0.4;
    frame.cascades = problem.cascades;
    views_ = training_views(capture_, frame);
    options_.grid.levels = problem.levels;
    options_.grid.log2_rows = problem.log2_rows;
    options_.grid.coarsest_resolution = 4;
    options_.grid.finest_resolution = problem.finest;
    options_.occupancy.resolution = 32;
    options_.cascades = problem.cascades;
    options_.march = march_settings(problem.cascades, 64, 1.0 / 64);
    options_.samples_per_step = problem.samples_per_step;
    options_.distortion_weight = problem.distortion_weight;
    if (problem.with_sky) sky_.show_to(views_);
    options_.depth.weight = problem.depth_weight;
    if (problem.depth_weight > 0) depths_.show_to(views_);
    if (problem.learns_views) options_.learning = {int(views_.size()), 1, true, true};
  }

  [[nodiscard]] const std::vector<TrainingView>& views() const { return views_; }
  [[nodiscard]] const LuminanceEngineOptions& options() const { return options_; }
  [[nodiscard]] std::unique_ptr<LuminanceEngine> fresh(const Backend& backend) const {
    auto engine = backend.make([&](const Engines& engines) { return engines.make_luminance(options_); });
    engine->set_views(views_);
    return engine;
  }
  /// After so many steps on the generic processor.
  [[nodiscard]] std::unique_ptr<LuminanceEngine> trained(const Backend& backend, long steps) {
    std::unique_ptr<LuminanceEngine>& trainer = trained_[steps];
    if (!trainer) {
      trainer = fresh(reference_backend());
      const auto earlier = trained_.find(40);
      if (steps > 40 && earlier != trained_.end()) copy_state(*earlier->second, *trainer);
      while (trainer->step_count() < steps) trainer->step(trainer->step_count() < 40 ? 1e-2f : 1e-3f);
    }
    auto engine = fresh(backend);
    copy_state(*trainer, *engine);
    return engine;
  }

 private:
  Capture capture_;
  ToySky sky_{6, 48 * 40};
  ToyDepths depths_{6};
  std::vector<TrainingView> views_;
  LuminanceEngineOptions options_;
  std::map<long, std::unique_ptr<LuminanceEngine>> trained_;  // by steps
};

void append_gradients(LuminanceEngine& engine, std::vector<Result>& results) {
  const Stage1Gradients found = gradients_of_next_step(engine);
  results.push_back({"rays", {double(found.report.rays)}});
  results.push_back({"trained samples", {double(found.report.trained_samples)}});
  results.push_back({"loss", {found.report.loss}});
  results.push_back({"squared error", {found.report.squared_error}});
  results.push_back({"gradient of the table", doubles(found.table)});
  results.push_back({"gradient of the nets", doubles(found.weights)});
  if (found.views.empty()) return;
  std::vector<double> by_gain, by_pose;
  for (std::size_t i = 0; i < found.views.size(); ++i) {
    (i % kViewNumbers == 0 ? by_gain : by_pose).push_back(found.views[i]);
  }
  results.push_back({"gradient of the gains", by_gain});
  results.push_back({"gradient of the poses", by_pose});
  results.push_back({"gradient of the lens", doubles(found.lenses)});
}

void append_queries(const LuminanceEngine& engine, std::vector<Result>& results) {
  SequentialRng rng(11, 3);
  std::vector<Vec3f> points, directions;
  for (int i = 0; i < 5003; ++i) {
    points.push_back({rng.uniform(), rng.uniform(), rng.uniform()});
    directions.push_back(normalized(Vec3f{rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)}));
  }
  std::vector<float> answers(points.size());
  engine.query_density(points, answers);
  results.push_back({"density of points", doubles(answers)});
  engine.query_luminance(points, directions, answers);
  results.push_back({"luminance of points", doubles(answers)});
}

/// Colour engines read pixels that were traced as they read them from the host's memory.
/// @param taught  what colours are trained on
void expect_colors_of_traced_pixels(const TracedPixels& traced, const PixelSamples& expected,
                                    const PixelSamples& taught, const Backend& backend) {
  constexpr HashGridOptions kGrid = {.levels = 8, .log2_rows = 12, .coarsest_resolution = 4, .finest_resolution = 64};
  std::vector<Ab> colors(expected.pixels()), expected_colors(expected.pixels());
  const auto farthest = [&] {
    float most = 0;
    for (std::size_t r = 0; r < colors.size(); ++r) {
      if (traced.results()[r].opacity < kLeastColoredOpacity) continue;
      most =
          std::max({most, std::abs(colors[r].a - expected_colors[r].a), std::abs(colors[r].b - expected_colors[r].b)});
    }
    return most;
  };
  const auto bins = backend.make([&](const Engines& engines) { return engines.make_color_bins(kGrid, 5); });
  bins->decode_traced(traced, 0.38f, colors);
  bins->decode(expected, 0.38f, expected_colors);
  EXPECT_LT(farthest(), 1e-3f) << "decoded colours of traced pixels";

  const auto field = backend.make([&](const Engines& engines) { return engines.make_color_field(kGrid, 6); });
  const std::vector<Ab> orange(taught.pixels(), {30, 50});
  for (int i = 0; i < 20; ++i) field->step(taught, orange, {}, AbLoss::kHuber, 1e-2f);
  field->composite_traced(traced, colors);
  field->composite(expected, expected_colors);
  EXPECT_LT(farthest(), 1e-2f) << "composited colours of traced pixels";
  EXPECT_GT(std::ranges::max(expected_colors, {}, &Ab::b).b, 10) << "which are not grey";
}

/// The heaviest samples of rays, in the engine's own memory and as `trace` hands them out.
void append_traced_pixels(const LuminanceEngine& engine, std::span<const Ray> rays, const MarchSettings& march,
                          const Backend& backend, std::vector<Result>& results) {
  const RenderEffort effort{1e-3f, 0.98f};
  std::vector<WeightedSample> samples;
  std::vector<std::size_t> offsets;
  engine.trace(rays, march, effort, samples, offsets);
  const PixelSamples expected = pixel_samples(rays, samples, offsets);
  const std::unique_ptr<TracedPixels> traced = engine.trace_pixels(rays, march, effort);
  // Memory that is handed out again must not be that of pixels somebody still holds.
  const std::unique_ptr<TracedPixels> others = engine.trace_pixels(rays.first(rays.size() / 2), march, effort);
  EXPECT_EQ(traced->samples().offsets, expected.offsets);
  EXPECT_EQ(traced->samples().weights, expected.weights);
  EXPECT_EQ(traced->samples().luminance, expected.luminance);
  ASSERT_EQ(traced->samples().positions.size(), expected.positions.size());
  float farthest = 0;
  for (std::size_t s = 0; s < expected.positions.size(); ++s) {
    farthest = std::max(farthest, length(traced->samples().positions[s] - expected.positions[s]));
  }
  EXPECT_LT(farthest, 1e-6f);
  std::vector<double> luminance, opacity, depth;
  ASSERT_EQ(traced->results().size(), rays.size());
  for (std::size_t r = 0; r < rays.size(); ++r) {
    const RayResult& seen = traced->results()[r];
    luminance.push_back(seen.luminance);
    opacity.push_back(seen.opacity);
    depth.push_back(seen.depth * seen.opacity);
    EXPECT_NEAR(seen.opacity, expected.opacity(r), 1e-5f);
  }
  const auto middle = rays.subspan(rays.size() * 3 / 8, rays.size() / 4);  // rows that show most of what is there
  engine.trace(middle, march, effort, samples, offsets);
  expect_colors_of_traced_pixels(*traced, expected, pixel_samples(middle, samples, offsets), backend);
  results.push_back({"luminance of the heaviest samples", luminance});
  results.push_back({"opacity of the heaviest samples", opacity});
  results.push_back({"depth of the heaviest samples", depth});
  results.push_back({"number of the heaviest samples", {double(expected.offsets.back())}});
}

void append_pictures(const Scene& scene, const LuminanceEngine& engine, const Backend& backend,
                     std::vector<Result>& results) {
  const UnitCamera& camera = scene.views()[1].camera;
  std::vector<Ray> rays;
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 48; ++x) rays.push_back(camera.ray({x + 0.5, y + 0.5}));
  }
  std::vector<RayResult> seen(rays.size()), of_view(rays.size());
  engine.render(rays, scene.options().march, {}, seen);
  engine.render_view(camera, scene.options().march, {}, of_view);
  std::vector<double> luminance, opacity, depth, luminance_of_view, traced(rays.size(), 0.0);
  for (std::size_t r = 0; r < rays.size(); ++r) {
    luminance.push_back(seen[r].luminance);
    luminance_of_view.push_back(of_view[r].luminance);
    opacity.push_back(seen[r].opacity);
    depth.push_back(seen[r].depth * seen[r].opacity);
  }
  EXPECT_LT(relative_distance(luminance_of_view, luminance), 1e-5) << "a view is its rays";

  std::vector<WeightedSample> samples;
  std::vector<std::size_t> offsets;
  engine.trace(rays, scene.options().march, {}, samples, offsets);
  ASSERT_EQ(offsets.size(), rays.size() + 1);
  ASSERT_EQ(offsets.back(), samples.size());
  bool in_order = true;
  for (std::size_t r = 0; r < rays.size(); ++r) {
    for (std::size_t s = offsets[r]; s < offsets[r + 1]; ++s) {
      traced[r] += double(samples[s].weight) * samples[s].luminance;
      in_order = in_order && (s == offsets[r] || samples[s].t > samples[s - 1].t);
    }
  }
  EXPECT_TRUE(in_order) << "traced samples";
  // A ray may end one sample earlier, behind a surface that hides all but this share of what follows.
  EXPECT_LT(relative_distance(traced, luminance), 1e-3) << "traced samples add up to the picture";
  append_traced_pixels(engine, rays, scene.options().march, backend, results);
  results.push_back({"rendered luminance", luminance});
  results.push_back({"rendered opacity", opacity});
  results.push_back({"rendered depth", depth});
}

/// A step with an update of the occupancy grid.
void append_step(LuminanceEngine& engine, std::vector<Result>& results) {
  engine.step(1e-3f);
  for (const StatePiece& piece : engine.state()) {
    if (piece.name != "counters") results.push_back({"after a step: " + piece.name, doubles(floats_of(piece))});
  }
}

Op stage1(const Problem& problem) {
  const auto scene = std::make_shared<Scene>(problem);
  Op op;
  op.name = problem.name;
  op.run = [scene](const Backend& backend) {
    std::vector<Result> results;
    const auto engine = scene->trained(backend, 40);
    append_gradients(*engine, results);
    append_queries(*engine, results);
    append_pictures(*scene, *engine, backend, results);
    append_step(*scene->trained(backend, 48), results);
    return results;
  };
  // Lattice points on the face of a cell may fall on either side; a ray may end one sample earlier.
  op.bounds = {{"rays", 0, 0},
               {"trained samples", 1e-3, 5e-3},
               {"loss", 1e-3, 5e-3},
               {"squared error", 1e-3, 5e-3},
               {"gradient of the table", 1e-3, 3e-2},
               {"gradient of the nets", 1e-3, 3e-2, Measure::kGradient}};
  std::vector<std::string> pieces = {"grid.table",
                                     "grid.moments",
                                     "density_net.weights",
                                     "density_net.first_moments",
                                     "density_net.second_moments",
                                     "luminance_net.weights",
                                     "luminance_net.first_moments",
                                     "luminance_net.second_moments",
                                     "occupancy"};
  if (problem.learns_views) {
    op.bounds.push_back({"gradient of the gains", 1e-3, 1e-2, Measure::kGradient});
    op.bounds.push_back({"gradient of the poses", 1e-3, 3e-2, Measure::kGradient});
    op.bounds.push_back({"gradient of the lens", 1e-3, 3e-2, Measure::kGradient});
    pieces.insert(pieces.end(), {"views", "views.moments", "lenses", "lenses.moments"});
  }
  op.bounds.push_back({"density of points", 1e-4, 1e-2});
  op.bounds.push_back({"luminance of points", 1e-4, 5e-3});
  for (const char* seen :
       {"luminance of the heaviest samples", "opacity of the heaviest samples", "depth of the heaviest samples",
        "number of the heaviest samples", "rendered luminance", "rendered opacity", "rendered depth"}) {
    op.bounds.push_back({seen, 1e-3, 1e-2});
  }
  // Where gradients are mostly noise, Adam's step has either sign.
  for (const std::string& piece : pieces) {
    op.bounds.push_back({"after a step: " + piece, 1e-2, piece.ends_with("moments") ? 3e-2 : 1e-2});
  }
  return op;
}

/// A step has some rays at least, with all of their samples, however few it aims at.
Op stage1_of_few_samples(const Problem& problem) {
  const auto scene = std::make_shared<Scene>(problem);
  Op op;
  op.name = problem.name;
  op.run = [scene](const Backend& backend) -> std::vector<Result> {
    const StepReport report = gradients_of_next_step(*scene->trained(backend, 40)).report;
    return {{"rays", {double(report.rays)}},
            {"trained samples", {double(report.trained_samples)}},
            {"loss", {report.loss}}};
  };
  op.bounds = {{"rays", 0, 0}, {"trained samples", 1e-3, 1e-2}, {"loss", 1e-3, 1e-2}};
  return op;
}

/// Engines that share a step find the gradients of one that has it alone, and stay equal.
/// @param parts  that a grid's rows can be dealt out to, or not
Op stage1_shared(const Problem& problem, int parts) {
  const auto scene = std::make_shared<Scene>(problem);
  Op op = stage1(problem);
  std::erase_if(op.bounds, [](const Bound& bound) {
    const bool is_of_step = bound.result.starts_with("gradient") || bound.result == "rays" || bound.result == "loss" ||
                            bound.result == "trained samples" || bound.result == "squared error";
    return !is_of_step;
  });
  op.expected = [scene] {
    std::vector<Result> results;
    append_gradients(*scene->trained(reference_backend(), 40), results);
    return results;
  };
  op.run = [scene, parts](const Backend& backend) {
    std::vector<std::unique_ptr<LuminanceEngine>> engines;
    for (int part = 0; part < parts; ++part) engines.push_back(scene->trained(backend, 40));
    ThreadsExchange exchange(parts);
    std::vector<std::vector<Result>> results{std::size_t(parts), std::vector<Result>()};
    std::vector<std::jthread> threads;
    for (int part = 0; part < parts; ++part) {
      threads.emplace_back([&, part] {
        LuminanceEngine& engine = *engines[std::size_t(part)];
        engine.share_steps(exchange.share(part));
        append_gradients(engine, results[std::size_t(part)]);
        for (int step = 0; step < 3; ++step) engine.step(1e-3f);
        engine.complete_state();
      });
    }
    threads.clear();
    const std::vector<StatePiece> state = engines.front()->state();
    for (int part = 1; part < parts; ++part) {
      const std::vector<StatePiece> others = engines[std::size_t(part)]->state();
      for (std::size_t i = 0; i < state.size(); ++i) {
        EXPECT_TRUE(std::ranges::equal(state[i].bytes, others[i].bytes)) << state[i].name << " of part " << part;
      }
    }
    return results[0];
  };
  return op;
}

#if CNERF_CUDA_ENGINE
/// Of views that take turns on the GPU, a step draws from those that are there: what it finds is what the processor
/// finds of these alone.
Op stage1_in_turns(const Problem& problem) {
  constexpr long kResident = 2, kSteps = 40;
  const auto scene = std::make_shared<Scene>(problem);
  Op op = stage1_shared(problem, 3);  // for its bounds
  op.is_gpu_only = true;
  op.expected = [scene] {
    const auto engine = scene->trained(reference_backend(), kSteps);
    std::vector<TrainingView> resident;
    for (const std::size_t v : ViewRotation::views_of_step(kSteps, scene->views().size(), kResident)) {
      resident.push_back(scene->views()[v]);
    }
    engine->set_views(resident);
    std::vector<Result> results;
    append_gradients(*engine, results);
    return results;
  };
  op.run = [scene](const Backend& backend) {
    const auto engine = scene->trained(backend, kSteps);
    constexpr std::size_t kSlot = (48 * 40 + 255) / 256 * 256 + 4 * 256;
    constexpr std::size_t kMemory = (kResident + 1) * kSlot;
    EXPECT_LT(kMemory, scene->views().size() * pixel_bytes(scene->views().front())) << "all views fit";
    engine->limit_image_memory(kMemory);
    engine->set_views(scene->views());
    std::vector<Result> results;
    append_gradients(*engine, results);
    return results;
  };
  return op;
}
#endif

/// Rounding sends back ends apart. Losses are averaged, since a step's depends mostly on the pixels it drew.
Op stage1_learning(const Problem& problem) {
  const auto scene = std::make_shared<Scene>(problem);
  Op op;
  op.name = problem.name;
  op.is_gpu_only = true;
  op.run = [scene](const Backend& backend) -> std::vector<Result> {
    const auto engine = scene->fresh(backend);
    const double first = engine->step(1e-2f).loss;
    for (int i = 0; i < 250; ++i) engine->step(1e-2f);
    double last = 0;
    for (int i = 0; i < 50; ++i) last += engine->step(1e-2f).loss / 50;
    EXPECT_LT(last, 0.5 * first);
    return {{"loss after 300 steps", {last}}};
  };
  op.bounds = {{"loss after 300 steps", 0, 0.6}};
  return op;
}

Op out_of_memory() {
  Op op;
  op.name = "OutOfMemorySaysWhatToLower";
  op.is_gpu_only = true;
  op.run = [](const Backend& backend) -> std::vector<Result> {
    std::string message;
#if CNERF_CUDA_ENGINE
    try {
      if (backend.is_gpu()) {
        const DeviceBuffer<float> huge(std::size_t(1) << 42, "the hash grid; lower stage1.grid.log2_rows");
      }
    } catch (const DeviceError& failure) {
      message = failure.what();
    }
#endif
    const bool is_said = message.find("lower stage1.grid.log2_rows") != std::string::npos;
    return {{"message", {is_said || !backend.is_gpu() ? 1.0 : 0.0}}};
  };
  op.bounds = {{"message", 0, 0}};
  return op;
}

}  // namespace

std::vector<Op> luminance_ops() {
  return {
    stage1({"Stage1WithExposures", 8, 14, 64, 1, false, false, true}),
        stage1({"Stage1WithDistortionLoss", 8, 14, 64, 2, false, false, false, 0.3f}),
        stage1({"Stage1WithAlpha", 3, 12, 20, 1, true}),
        stage1({"Stage1WithCascadesLensAndMask", 12, 14, 128, 3, false, true}),
        stage1({"Stage1WithManyLevels", 16, 13, 128, 2}),
        stage1({"Stage1WithLearnedViews", 8, 14, 64, 2, false, true, true, 0, true}),
        stage1({"Stage1WithSky", 8, 14, 64, 2, false, false, true, 0.1f, true, true}),
        stage1({"Stage1WithDepth", 8, 14, 64, 2, false, false, false, 0.1f, false, false, 0.1f}),
        stage1_of_few_samples({.name = "Stage1OfFewSamples",
                               .levels = 8,
                               .log2_rows = 14,
                               .finest = 64,
                               .cascades = 1,
                               .samples_per_step = 512}),
        stage1_shared({"Stage1Shared", 8, 14, 64, 2, false, true, true, 0.1f, true}, 3),
        stage1_shared({"Stage1SharedInPieces", 8, 14, 64, 2, false, true, true, 0.1f, true}, 2),
        stage1_learning({"Stage1Learns", 8, 14, 64, 1, false, false, true}),
        stage1_learning({"Stage1LearnsWithCascades", 12, 14, 128, 3, false, true}),
#if CNERF_CUDA_ENGINE
        stage1_in_turns({.name = "Stage1WithViewsInTurns", .levels = 8, .log2_rows = 14, .finest = 64, .cascades = 1}),
#endif
        out_of_memory()
  };
}

}  // namespace cnerf::test
