// The whole step of stage 1, from parameters to the loss, against finite differences of a forward pass in double that
// shares only the header-only maths with the engine.

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

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

/// The loss of the engine's next step, as a function of its parameters, in double.
class LossInDouble {
 public:
  LossInDouble(const LuminanceEngine& engine, const LuminanceEngineOptions& options,
               const std::vector<TrainingView>& views, std::size_t n_rays)
      : levels_(hash_grid_levels(options.grid)),
        density_(density_net_layout(options.grid.levels)),
        luminance_(luminance_net_layout()),
        max_luminance_(options.max_luminance),
        distortion_weight_(options.distortion_weight) {
    for (std::size_t r = 0; r < n_rays; ++r) {
      rays_.push_back(observe_ray(views, options.seed, std::uint64_t(engine.step_count()), r));
      RayMarcher marcher(engine.occupancy(), options.march, rays_.back().ray, rays_.back().jitter);
      samples_.emplace_back();
      for (RaySample sample; marcher.next(sample);) samples_.back().push_back(sample);
    }
  }

  /// @param parameters  table, then both nets' weights
  double operator()(const std::vector<double>& parameters) const {
    const std::size_t table_size = std::size_t(total_rows(levels_)) * 4;
    const std::vector<double> table(parameters.begin(), parameters.begin() + long(table_size));
    const auto weights_at = [&](std::size_t offset, const MlpLayout& layout) {
      const auto begin = parameters.begin() + long(table_size + offset);
      return MlpReference<double>{layout, std::vector<double>(begin, begin + long(layout.weight_count()))};
    };
    const MlpReference<double> density_net = weights_at(0, density_);
    const MlpReference<double> luminance_net = weights_at(density_.weight_count(), luminance_);
    const auto activation = LuminanceActivation<double>::up_to(max_luminance_);

    double loss = 0;
    for (std::size_t r = 0; r < rays_.size(); ++r) {
      Compositor<double> seen;
      Distortion<double> distortion;
      for (const RaySample& sample : samples_[r]) {
        const Vec3f p = rays_[r].ray.at(sample.t);
        const std::vector<double> position = {std::clamp(double(p.x), 0.0, 1.0), std::clamp(double(p.y), 0.0, 1.0),
                                              std::clamp(double(p.z), 0.0, 1.0)};
        std::vector<double> features = density_net.forward(encode_reference(levels_, table, position)).back();
        const double sigma = density_from_raw(features[0], 1.0);
        const Vec3d d = rays_[r].ray.direction.cast<double>();
        spherical_harmonics(d.x, d.y, d.z, [&](int, double value) { features.push_back(value); });
        const double weight =
            seen.add(alpha_of(sigma, double(sample.dt)), activation.value(luminance_net.forward(features).back()[0]));
        distortion.add(weight, {double(sample.t), double(sample.dt)});
      }
      const double background = rays_[r].target.background;
      const double wanted = rays_[r].target.luminance + (1.0 - rays_[r].target.coverage) * background;
      const double error =
          (lightness_from_luminance(seen.value + seen.transmittance * background) - lightness_from_luminance(wanted)) /
          100.0;
      loss += (error * error + distortion_weight_ * distortion.value) / double(rays_.size());
    }
    return loss;
  }

 private:
  std::vector<GridLevel> levels_;
  MlpLayout density_, luminance_;
  double max_luminance_, distortion_weight_;
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

struct Loss {
  const char* name;
  bool with_alpha;
  float distortion_weight;
};

class LuminanceGradient : public testing::TestWithParam<Loss> {};

TEST_P(LuminanceGradient, MatchesFiniteDifferencesOfTheLoss) {
  const Capture capture = test::toy_capture(4, 24, 20, GetParam().with_alpha);
  LuminanceEngineOptions options = small_engine();
  options.distortion_weight = GetParam().distortion_weight;
  SceneFrame frame;
  frame.unit_per_world = 0.4;
  const std::vector<TrainingView> views = training_views(capture, frame);
  for (const IsaLevel isa : test::available_isas()) {
    const test::ScopedIsa scope(isa);
    const auto engine = make_cpu_luminance_engine(options);
    engine->set_views(views);
    for (int i = 0; i < 12; ++i) engine->step(1e-2f);  // away from the symmetric start
    const test::Stage1Gradients analytic = test::gradients_of_next_step(*engine);
    ASSERT_GT(analytic.report.trained_samples, 200u);

    std::vector<double> parameters;
    const std::vector<StatePiece> state = engine->state();
    for (const char* piece : {"grid.table", "density_net.weights", "luminance_net.weights"}) {
      const std::span<const float> values = test::floats_of(state, piece);
      parameters.insert(parameters.end(), values.begin(), values.end());
    }
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
    EXPECT_LT(test::relative_distance(chosen, numeric), 5e-3) << to_string(isa);
    std::vector<double> flipped = chosen;
    for (double& value : flipped) value = -value;
    EXPECT_GT(test::relative_distance(flipped, numeric), 1.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Of, LuminanceGradient,
                         testing::Values(Loss{"Opaque", false, 0}, Loss{"WithAlpha", true, 0},
                                         Loss{"Distortion", false, 0.3f}, Loss{"DistortionAndAlpha", true, 0.3f}),
                         [](const auto& param_info) { return param_info.param.name; });

TEST(LuminanceEngine, StepsAreBitEqualForAnyNumberOfThreads) {
  const Capture capture = test::toy_capture();
  SceneFrame frame;
  frame.unit_per_world = 0.4;
  const std::vector<TrainingView> views = training_views(capture, frame);
  std::vector<std::vector<std::byte>> tables;
  for (const int threads : {1, 2, 4}) {
    set_thread_count(threads);
    const auto engine = make_cpu_luminance_engine(small_engine());
    engine->set_views(views);
    for (int i = 0; i < 40; ++i) engine->step(1e-2f);
    const StatePiece table = engine->state().front();
    tables.emplace_back(table.bytes.begin(), table.bytes.end());
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
