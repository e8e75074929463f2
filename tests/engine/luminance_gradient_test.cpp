// The whole step of stage 1, from parameters to the loss, against finite differences of a forward pass in double that
// shares only the header-only maths with the engine. By one instruction set: backend_ops_test.cpp proves the others,
// and the GPU, equal to it.

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <optional>

#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"
#include "src/engine/luminance_engine.h"
#include "src/field/luminance_activation.h"
#include "src/field/nets.h"
#include "src/render/composite_math.h"
#include "src/render/distortion_math.h"
#include "tests/support/engine_state.h"
#include "tests/support/finite_difference.h"
#include "tests/support/hash_grid_reference.h"
#include "tests/support/isa.h"
#include "tests/support/mlp_reference.h"
#include "tests/support/toy_capture.h"

namespace cnerf {
namespace {

LuminanceEngineOptions small_engine() {
  LuminanceEngineOptions options;
  options.grid.levels = 3;
  options.grid.log2_rows = 8;
  options.grid.coarsest_resolution = 3;
  options.grid.finest_resolution = 20;
  options.occupancy.resolution = 16;
  options.march = march_settings(1, 16, 0);
  options.samples_per_step = 384;  // 24 rays
  return options;
}

TEST(ImageMemory, OfADeviceIsNoMoreThanItHasFree) {
  constexpr std::size_t kGiB = std::size_t(1) << 30;
  EXPECT_EQ(image_memory_on_device(2 * kGiB, 80 * kGiB), 2 * kGiB);
  EXPECT_LT(image_memory_on_device(16 * kGiB, 8 * kGiB), 8 * kGiB);
  EXPECT_GT(image_memory_on_device(16 * kGiB, 8 * kGiB), 4 * kGiB);
  EXPECT_EQ(image_memory_on_device(kGiB, 0), 0u);
}

/// The loss of the engine's next step, as a function of its parameters, in double.
class LossInDouble {
 public:
  LossInDouble(const LuminanceEngine& engine, const LuminanceEngineOptions& options,
               const std::vector<TrainingView>& views, std::size_t n_rays)
      : levels_(hash_grid_levels(options.grid)),
        density_(density_net_layout(options.grid.levels)),
        luminance_(luminance_net_layout()),
        max_luminance_(options.max_luminance),
        distortion_weight_(options.distortion_weight),
        depth_weight_(options.depth.weight_at(engine.step_count())),
        learning_(options.learning),
        views_(views) {
    for (std::size_t r = 0; r < n_rays; ++r) {
      rays_.push_back(observe_ray(views, options.seed, std::uint64_t(engine.step_count()), r));
      RayMarcher marcher(engine.occupancy(), options.march, rays_.back().ray, rays_.back().jitter);
      samples_.emplace_back();
      for (RaySample sample; marcher.next(sample);) samples_.back().push_back(sample);
    }
  }

  /// @param parameters  table, both nets' weights, then where they are learned: each view's gain, turn and shift, and
  ///                    the lens's numbers
  double operator()(const std::vector<double>& parameters) const {
    const std::size_t table_size = std::size_t(total_rows(levels_)) * 4;
    const std::vector<double> table(parameters.begin(), parameters.begin() + long(table_size));
    const auto weights_at = [&](std::size_t offset, const MlpLayout& layout) {
      const auto begin = parameters.begin() + long(table_size + offset);
      return MlpReference<double>{layout, std::vector<double>(begin, begin + long(layout.weight_count()))};
    };
    const MlpReference<double> density_net = weights_at(0, density_);
    const MlpReference<double> luminance_net = weights_at(density_.weight_count(), luminance_);
    const std::size_t first_view = table_size + density_.weight_count() + luminance_.weight_count();
    const auto activation = LuminanceActivation<double>::up_to(max_luminance_);

    double loss = 0;
    for (std::size_t r = 0; r < rays_.size(); ++r) {
      Compositor<double> seen;
      Distortion<double> distortion;
      double depth = 0;
      const DepthHint& hint = rays_[r].target.depth;
      const Correction correction = correction_of(parameters, first_view, r);
      for (const RaySample& sample : samples_[r]) {
        const Vec3d p = correction.applied_to(rays_[r].ray, double(sample.t));
        const std::vector<double> position = {std::clamp(p.x, 0.0, 1.0), std::clamp(p.y, 0.0, 1.0),
                                              std::clamp(p.z, 0.0, 1.0)};
        std::vector<double> features = density_net.forward(encode_reference(levels_, table, position)).back();
        const double sigma = density_from_raw(features[0], 1.0);
        const Vec3d d = rays_[r].ray.direction.cast<double>();
        spherical_harmonics(d.x, d.y, d.z, [&](int, double value) { features.push_back(value); });
        const double weight =
            seen.add(alpha_of(sigma, double(sample.dt)), activation.value(luminance_net.forward(features).back()[0]));
        distortion.add(weight, {double(sample.t), double(sample.dt)});
        if (hint.is_known()) depth += weight * depth_miss(double(sample.t), hint);
      }
      if (hint.is_known()) depth += seen.transmittance;
      const double background = rays_[r].target.background;
      const double wanted = rays_[r].target.luminance + (1.0 - rays_[r].target.coverage) * background;
      // The sky's light is stated as the view has it, at the gain that the ray was drawn with.
      const double sky = rays_[r].target.sky / double(rays_[r].target.gain) * correction.gain;
      const double behind = seen.transmittance * (background + sky);
      const double error =
          (lightness_from_luminance(correction.gain * seen.value + behind) - lightness_from_luminance(wanted)) / 100.0;
      loss += (error * error + distortion_weight_ * distortion.value + depth_weight_ * depth) / double(rays_.size());
    }
    return loss;
  }

 private:
  struct Correction {
    double gain = 1;
    Vec3d turn, shift;
    std::optional<Vec3d> direction = {};  ///< of the ray through a lens that was corrected

    /// Directions alone, as the luminance net is asked for them, are not learned from.
    [[nodiscard]] Vec3d applied_to(const Ray& ray, double t) const {
      return ray.origin.cast<double>() + shift + t * turned(turn, direction.value_or(ray.direction.cast<double>()));
    }
  };
  /// Of a ray's view, as far as the ray teaches it.
  [[nodiscard]] Correction correction_of(const std::vector<double>& parameters, std::size_t first,
                                         std::size_t ray) const {
    if (parameters.size() == first) return {};
    const double* numbers = &parameters[first + kViewNumbers * rays_[ray].view];
    if (!learning_.teaches_camera(std::uint32_t(ray))) return {std::exp(numbers[0]), {}, {}};
    Correction correction{
        std::exp(numbers[0]), {numbers[1], numbers[2], numbers[3]}, {numbers[4], numbers[5], numbers[6]}};
    if (!learning_.teaches_lens(std::uint32_t(ray))) return correction;
    // The lens's numbers are too small for the engine's floats to be disturbed: its maths is done again in double.
    const double* lens = &parameters[first + std::size_t(kViewNumbers * learning_.views)];
    const UnitCamera& camera = views_[rays_[ray].view].camera;
    const auto pixel =
        project(camera.intrinsics, camera.unit_from_camera.transposed() * rays_[ray].ray.direction.cast<double>());
    Intrinsics moved = camera.intrinsics;
    moved.model = LensModel::kOpenCv;
    moved.cx += lens[1] * moved.fx;
    moved.cy += lens[2] * moved.fy;
    moved.fx *= std::exp(lens[0]);
    moved.fy *= std::exp(lens[0]);
    for (std::size_t i = 0; i < 4; ++i) moved.distortion[i] += lens[3 + i];
    correction.direction = camera.unit_from_camera * ray_direction(moved, pixel.value());
    return correction;
  }

  std::vector<GridLevel> levels_;
  MlpLayout density_, luminance_;
  double max_luminance_, distortion_weight_, depth_weight_;
  ViewLearning learning_;
  std::vector<TrainingView> views_;
  std::vector<ObservedRay> rays_;
  std::vector<std::vector<RaySample>> samples_;
};

/// Indices of the largest gradients, where a comparison says most, and some others.
std::vector<std::size_t> telling_indices(const std::vector<double>& gradient, std::size_t count) {
  std::vector<std::size_t> order(gradient.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return std::abs(gradient[a]) > std::abs(gradient[b]); });
  order.resize(std::min(order.size(), count));
  return order;
}

/// As LossInDouble takes them.
std::vector<double> trained_numbers(LuminanceEngine& engine) {
  std::vector<double> parameters;
  for (const StatePiece& piece : engine.state()) {
    const auto is_one_of = [&](const std::vector<std::string>& names) {
      return std::ranges::find(names, piece.name) != names.end();
    };
    if (!is_one_of({"grid.table", "density_net.weights", "luminance_net.weights", "views", "lenses"})) continue;
    const std::span<const float> values = test::floats_of(piece);
    parameters.insert(parameters.end(), values.begin(), values.end());
  }
  return parameters;
}

struct Loss {
  const char* name;
  bool with_alpha;
  float distortion_weight;
  bool with_sky = false;
  float depth_weight = 0;
};

class LuminanceGradient : public testing::TestWithParam<Loss> {};

TEST_P(LuminanceGradient, MatchesFiniteDifferencesOfTheLoss) {
  const Capture capture = test::toy_capture(4, 24, 20, GetParam().with_alpha);
  LuminanceEngineOptions options = small_engine();
  options.distortion_weight = GetParam().distortion_weight;
  SceneFrame frame;
  frame.unit_per_world = 0.4;
  std::vector<TrainingView> views = training_views(capture, frame);
  const test::ToySky sky(views.size(), 24 * 20);
  if (GetParam().with_sky) sky.show_to(views);
  options.depth.weight = GetParam().depth_weight;
  const test::ToyDepths depths(views.size());
  if (options.depth.weight > 0) depths.show_to(views);
  const test::ScopedIsa scope(IsaLevel::kGeneric);
  const auto engine = make_cpu_luminance_engine(options);
  engine->set_views(views);
  for (int i = 0; i < 12; ++i) engine->step(1e-2f);  // away from the symmetric start
  const test::Stage1Gradients analytic = test::gradients_of_next_step(*engine);
  ASSERT_GT(analytic.report.trained_samples, 200u);

  const std::vector<double> parameters = trained_numbers(*engine);
  std::vector<double> gradient(analytic.table.begin(), analytic.table.end());
  gradient.insert(gradient.end(), analytic.weights.begin(), analytic.weights.end());
  ASSERT_EQ(gradient.size(), parameters.size());

  const LossInDouble loss(*engine, options, views, analytic.report.rays);
  // The engine drops samples behind transmittance 1e-4: their part of the loss is below its square root.
  EXPECT_NEAR(loss(parameters), analytic.report.loss, 1e-4 * analytic.report.loss + 1e-6);

  const std::vector<std::size_t> indices = telling_indices(gradient, 40);
  const std::vector<double> numeric = test::central_difference(parameters, indices, 1e-5, loss);
  std::vector<double> chosen;
  for (const std::size_t i : indices) chosen.push_back(gradient[i]);
  // Float against double through exp and cube: measured below 1e-3.
  EXPECT_LT(test::relative_distance(chosen, numeric), 5e-3);
  std::vector<double> flipped = chosen;
  for (double& value : flipped) value = -value;
  EXPECT_GT(test::relative_distance(flipped, numeric), 1.0);
}

INSTANTIATE_TEST_SUITE_P(Of, LuminanceGradient,
                         testing::Values(Loss{"Opaque", false, 0}, Loss{"WithAlpha", true, 0},
                                         Loss{"Distortion", false, 0.3f}, Loss{"DistortionAndAlpha", true, 0.3f},
                                         Loss{"Sky", false, 0.1f, true}, Loss{"Depth", false, 0, false, 0.3f},
                                         Loss{"DepthDistortionAndSky", false, 0.1f, true, 0.3f}),
                         [](const auto& param_info) { return param_info.param.name; });

/// With a pinhole, whose distortion is learned from nothing, and with a lens that has some.
class ViewLearningWithLens : public testing::TestWithParam<bool> {};

TEST_P(ViewLearningWithLens, GradientsMatchFiniteDifferencesOfTheLoss) {
  Capture capture = test::toy_capture(4, 24, 20);
  for (View& view : capture.views) {
    if (!GetParam()) continue;
    view.intrinsics.model = LensModel::kOpenCv;
    view.intrinsics.distortion = {-0.1, 0.05, 2e-3, -3e-3, 0.01, 0.02, 0, 0};
  }
  LuminanceEngineOptions options = small_engine();
  options.learning = {4, 1, true, true};
  SceneFrame frame;
  frame.unit_per_world = 0.4;
  std::vector<TrainingView> views = training_views(capture, frame);
  const test::ToySky sky(views.size(), 24 * 20);
  sky.show_to(views);
  const test::ScopedIsa scope(IsaLevel::kGeneric);
  const auto engine = make_cpu_luminance_engine(options);
  engine->set_views(views);
  for (int i = 0; i < 12; ++i) engine->step(1e-2f);
  // The double reference bends rays as they are given: corrections start from nothing.
  for (const StatePiece& piece : engine->state()) {
    if (piece.name == "views" || piece.name == "lenses") std::ranges::fill(piece.bytes, std::byte{0});
  }
  engine->state_loaded();
  const test::Stage1Gradients analytic = test::gradients_of_next_step(*engine);

  const std::vector<double> parameters = trained_numbers(*engine);
  ASSERT_EQ(analytic.views.size(), 4u * kViewNumbers);
  ASSERT_EQ(analytic.lenses.size(), std::size_t(kLensNumbers));
  const LossInDouble loss(*engine, options, views, analytic.report.rays);
  EXPECT_NEAR(loss(parameters), analytic.report.loss, 1e-4 * analytic.report.loss + 1e-6);
  std::vector<std::size_t> indices(analytic.views.size());
  std::iota(indices.begin(), indices.end(), parameters.size() - kLensNumbers - indices.size());
  const std::vector<double> numeric = test::central_difference(parameters, indices, 1e-7, loss);
  for (const int first : {0, 1, 4}) {  // gains, turns, shifts: each on its own scale
    std::vector<double> found, expected;
    for (std::size_t i = 0; i < indices.size(); ++i) {
      const int number = int(i % kViewNumbers);
      if ((number == 0) != (first == 0) || (number >= 4) != (first == 4)) continue;
      found.push_back(analytic.views[i]);
      expected.push_back(numeric[i]);
    }
    EXPECT_LT(test::relative_distance(found, expected), 1e-2) << "numbers from " << first;
  }
  std::vector<std::size_t> of_lens(kLensNumbers);
  std::iota(of_lens.begin(), of_lens.end(), parameters.size() - kLensNumbers);
  const std::vector<double> lens = test::central_difference(parameters, of_lens, 1e-7, loss);
  for (std::size_t i = 0; i < lens.size(); ++i) {
    EXPECT_NEAR(analytic.lenses[i], lens[i], 0.02 * std::abs(lens[i]) + 1e-5) << "number " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Distorted, ViewLearningWithLens, testing::Bool());

TEST(ViewLearning, AFurtherRotationIsTakenToTheRotationVector) {
  for (const Vec3f turn : {Vec3f{0, 0, 0}, Vec3f{1e-4f, 0, 2e-4f}, Vec3f{0.3f, -0.2f, 0.5f}, Vec3f{-1, 1, 0.5f}}) {
    const Vec3d arm = {0.4, -0.7, 0.2}, pull = {1, 2, -0.5};
    ViewGradient gradient;
    gradient.add(turned(turn.cast<double>(), arm).cast<float>(), pull.cast<float>());
    const auto along = [&](const std::vector<double>& w) { return dot(turned(Vec3d{w[0], w[1], w[2]}, arm), pull); };
    const std::vector<double> numeric = test::central_difference({turn.x, turn.y, turn.z}, {0, 1, 2}, 1e-6, along);
    const Vec3f found = gradient.by_turn(turn);
    EXPECT_LT(test::relative_distance(std::vector<double>{found.x, found.y, found.z}, numeric), 1e-5);
  }
}

TEST(ViewLearning, TheGaugeTakesOffWhatAllViewsHaveInCommon) {
  const std::vector<Vec3f> origins = {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {0.2f, 0.4f, 0.8f}, {1, 1, 1}};
  const auto origin = [&](int v) { return origins[std::size_t(v)]; };
  std::vector<ViewCorrection> views(5);
  for (int v = 0; v < 5; ++v) {
    views[std::size_t(v)] = {0.1f * float(v), {0.01f, 0, 0}, Vec3f{0, 0.02f, 0} + 0.1f * origin(v)};
  }
  ViewGauge gauge = pose_gauge(views.data(), 5, origin);
  for (int v = 0; v < 5; ++v) {
    if (is_median_gain(views.data(), 5, v)) gauge.log_gain = views[std::size_t(v)].log_gain;
  }
  EXPECT_FLOAT_EQ(gauge.log_gain, 0.2f);
  EXPECT_NEAR(gauge.growth, 0.1f, 1e-6f);
  for (int v = 0; v < 5; ++v) {
    gauge.take_off(origin(v), views[std::size_t(v)]);
    EXPECT_LT(length(views[std::size_t(v)].turn) + length(views[std::size_t(v)].shift), 1e-6f);
    EXPECT_NEAR(views[std::size_t(v)].log_gain, 0.1f * float(v) - 0.2f, 1e-6f);
  }
}

TEST(ViewLearning, ExposuresOfViewsAreFound) {
  // All from one place: seen from different sides, a scene could shine with as many exposures.
  Capture capture = test::toy_capture(5, 32, 32);
  for (View& view : capture.views) {
    view.image.u8 = capture.views[0].image.u8;
    view.world_from_camera = capture.views[0].world_from_camera;
  }
  const std::vector<float> light = {0.7f, 1.25f, 1.0f, 0.85f, 1.1f};
  for (std::size_t v = 0; v < light.size(); ++v) capture.views[v].image.exposure = 1 / light[v];
  LuminanceEngineOptions options = small_engine();
  options.samples_per_step = 4096;
  options.max_luminance = 1;
  options.learning = {5, 0, true, false};
  SceneFrame frame;
  frame.unit_per_world = 0.4;
  const auto engine = make_cpu_luminance_engine(options);
  engine->set_views(training_views(capture, frame));
  for (int i = 0; i < 600; ++i) engine->step(i < 300 ? 1e-2f : 1e-3f);
  const std::vector<ViewCorrection> found = engine->view_corrections();
  for (std::size_t v = 0; v < light.size(); ++v) {
    EXPECT_NEAR(found[v].gain(), light[v], 0.08f) << "view " << v;  // the median view has 1
    EXPECT_EQ(found[v].turn, Vec3f());
  }
}

TEST(LuminanceEngine, StepsAreBitEqualForAnyNumberOfThreads) {
  const Capture capture = test::toy_capture();
  SceneFrame frame;
  frame.unit_per_world = 0.4;
  const std::vector<TrainingView> views = training_views(capture, frame);
  std::vector<std::vector<std::byte>> tables;
  for (const int threads : {1, 2, 4}) {
    set_thread_count(threads);
    LuminanceEngineOptions options = small_engine();
    options.learning = {int(views.size()), 1, true, true};
    const auto engine = make_cpu_luminance_engine(options);
    engine->set_views(views);
    for (int i = 0; i < 40; ++i) engine->step(1e-2f);
    tables.emplace_back();
    for (const StatePiece& piece : engine->state()) {
      tables.back().insert(tables.back().end(), piece.bytes.begin(), piece.bytes.end());
    }
  }
  set_thread_count(0);
  EXPECT_EQ(tables[0], tables[1]);
  EXPECT_EQ(tables[0], tables[2]);
}

TEST(LuminanceEngine, LearnsAndRendersWhatItLearned) {
  const Capture capture = test::toy_capture(8, 32, 32, /*with_alpha=*/true);
  SceneFrame frame;
  frame.unit_per_world = 0.4;
  const std::vector<TrainingView> views = training_views(capture, frame);
  LuminanceEngineOptions options = small_engine();
  options.march = march_settings(1, 64, 0);
  options.samples_per_step = 8192;
  const auto engine = make_cpu_luminance_engine(options);
  engine->set_views(views);
  const double first = engine->step(1e-2f).loss;
  double last = first;
  for (int i = 0; i < 150; ++i) last = engine->step(1e-2f).loss;
  EXPECT_LT(last, 0.3 * first);

  std::vector<Ray> rays;
  for (int i = 0; i < 32; ++i) rays.push_back(views[0].camera.ray({i + 0.5, 16.5}));
  std::vector<RayResult> results(rays.size()), of_view(32 * 32);
  engine->render_view(views[0].camera, options.march, {}, of_view);
  engine->render(rays, options.march, {}, results);
  EXPECT_LT(results.front().opacity, 0.5f);  // transparent corner
  EXPECT_GT(results[16].opacity, 0.5f);      // the disc
  EXPECT_EQ(of_view[16 * 32 + 16].luminance, results[16].luminance);

  std::vector<WeightedSample> samples;
  std::vector<std::size_t> offsets;
  engine->trace(rays, options.march, {}, samples, offsets);
  ASSERT_EQ(offsets.size(), rays.size() + 1);
  for (std::size_t r = 0; r < rays.size(); ++r) {
    float luminance = 0, opacity = 0;
    for (std::size_t s = offsets[r]; s < offsets[r + 1]; ++s) {
      luminance += samples[s].weight * samples[s].luminance;
      opacity += samples[s].weight;
      if (s > offsets[r]) {
        EXPECT_GT(samples[s].t, samples[s - 1].t);
      }
    }
    EXPECT_NEAR(luminance, results[r].luminance, 1e-5f);
    EXPECT_NEAR(opacity, results[r].opacity, 1e-5f);
  }

  // Shading only what weighs something saves samples, keeps each ray's opacity and hardly changes its light.
  std::vector<WeightedSample> heavy;
  std::vector<std::size_t> heavy_offsets;
  engine->trace(rays, options.march, {1e-3f, 0.98f}, heavy, heavy_offsets);
  EXPECT_LT(heavy.size(), samples.size());
  for (std::size_t r = 0; r < rays.size(); ++r) {
    float luminance = 0, opacity = 0;
    for (std::size_t s = heavy_offsets[r]; s < heavy_offsets[r + 1]; ++s) {
      luminance += heavy[s].weight * heavy[s].luminance;
      opacity += heavy[s].weight;
    }
    EXPECT_NEAR(opacity, results[r].opacity, 1e-5f);
    EXPECT_NEAR(luminance, results[r].luminance, 0.04f * opacity);
  }
}

}  // namespace
}  // namespace cnerf
