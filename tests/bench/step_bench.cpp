// A whole step of stage 1 (march, forward, backward, Adam) on a real capture: two threads against one, and against the
// same mathematics out of LibTorch's operators and autograd, same configuration, same samples, in the same run. Neither
// learns exposures or has the loss of distortion; WholeStep/default has both, and no counterpart in LibTorch.
//
//   step_bench CAPTURE [--downscale N] [--threads N] [options of Google Benchmark]
//
// LibTorch is spared the marching: it gets the samples in occupied space, finds those that light reaches, and trains on
// them. It repeats one batch.

#include <benchmark/benchmark.h>

#include <CLI/CLI.hpp>
#include <filesystem>

#include "encoding/cpu/hash_grid_kernels.h"
#include "src/base/parallel.h"
#include "src/capture/load_capture.h"
#include "src/engine/luminance_engine.h"
#include "src/engine/stage1_schedule.h"
#include "src/field/nets.h"
#include "src/train/luminance/luminance_model.h"
#include "tests/bench/bench_support.h"
#include "tests/support/engine_state.h"
#include "tests/support/isa.h"
#include "tests/support/torch_oracle.h"

namespace cnerf {
namespace {

// Until the grid knows empty space and steps have their full size; the next one does not update the grid first.
constexpr int kWarmUpSteps = 25 * int(kOccupancyEvery) + 1;
constexpr int kRounds = 8, kStepsARound = 6;
constexpr float kLearningRate = 1e-2f, kTrainingTransmittance = 1e-4f;

/// What LibTorch's step computes too.
Stage1Options plain_options() {
  Stage1Options options;
  options.distortion_weight = options.depth_weight = 0;
  options.exposures = options.sky = false;
  return options;
}

/// A field in the middle of its training.
struct Training {
  Training(const Capture& from, const Stage1Options& stage1)
      : capture(from),
        model(LuminanceModel::create(capture, stage1, cpu_engines())),
        views(training_views(capture, model.frame)),
        engine(*model.engine) {
    options.grid = model.options.grid;
    options.cascades = model.frame.cascades;
    options.march = model.march();
    options.max_luminance = model.max_luminance;
    options.seed = std::uint64_t(model.options.seed);
    engine.set_views(views);
    for (int i = 0; i < kWarmUpSteps; ++i) engine.step(kLearningRate);
  }

  const Capture& capture;
  LuminanceModel model;
  std::vector<TrainingView> views;
  LuminanceEngine& engine;
  LuminanceEngineOptions options;
};

/// Seconds a trained sample over a few steps.
double engine_seconds(Training& training, int threads) {
  set_thread_count(threads);
  double samples = 0;
  const double seconds = bench::best_seconds(1, [&] {
    for (int i = 0; i < kStepsARound; ++i) {
      samples += double(training.engine.step(kLearningRate).trained_samples);
    }
  });
  set_thread_count(0);
  return seconds / samples;
}

/// The engine's next step in LibTorch.
class TorchStep {
 public:
  explicit TorchStep(Training& training)
      : engine_(training.engine), options_(training.options), levels_(hash_grid_levels(options_.grid)) {
    wanted_ = test::gradients_of_next_step(engine_);
    march(training);
    const std::vector<StatePiece> state = engine_.state();
    const std::span<const float> table = test::floats_of(state, "grid.table");
    table_ = torch::tensor(std::vector<float>(table.begin(), table.end())).view({-1, 4}).requires_grad_(true);
    density_layers_ = test::layers_of(density_net_layout(options_.grid.levels),
                                      test::floats_of(state, "density_net.weights"), torch::kFloat32);
    luminance_layers_ =
        test::layers_of(luminance_net_layout(), test::floats_of(state, "luminance_net.weights"), torch::kFloat32);
    std::vector<torch::Tensor> parameters = {table_};
    for (const auto* layers : {&density_layers_, &luminance_layers_}) {
      parameters.insert(parameters.end(), layers->begin(), layers->end());
    }
    adam_ = std::make_unique<torch::optim::Adam>(
        parameters, torch::optim::AdamOptions(kLearningRate).betas({0.9, 0.99}).eps(1e-15));
  }

  /// Loss and gradients as the engine finds them, up to float sums, or to products of bf16 numbers.
  void verify() {
    std::int64_t trained = 0;
    const torch::Tensor value = loss(trained);
    value.backward();
    bench::require(std::abs(value.item<double>() - wanted_.report.loss) < 1e-3 * wanted_.report.loss,
                   "LibTorch's loss differs from the engine's");
    const torch::Tensor expected = torch::tensor(wanted_.table).view({-1, 4});
    const auto difference = ((table_.grad() - expected).norm() / expected.norm()).item<double>();
    bench::require(difference < (active_isa() == IsaLevel::kAvx512Bf16 ? 1e-1 : 1e-2),
                   "LibTorch's gradient differs from the engine's");
    adam_->zero_grad();
  }
  /// @return  samples trained on
  double step() {
    std::int64_t trained = 0;
    loss(trained).backward();
    adam_->step();
    adam_->zero_grad();
    return double(trained);
  }

 private:
  /// The rays of the next step and all samples on them in occupied space.
  void march(const Training& training) {
    std::vector<float> positions, dt, targets, backgrounds;
    std::vector<std::int64_t> ray_of;
    std::vector<torch::Tensor> directions;
    for (std::size_t r = 0; r < wanted_.report.rays; ++r) {
      const ObservedRay observed = observe_ray(training.views, options_.seed, std::uint64_t(engine_.step_count()), r);
      RayMarcher marcher(engine_.occupancy(), options_.march, observed.ray, observed.jitter);
      for (RaySample sample; marcher.next(sample);) {
        const Vec3f p = observed.ray.at(sample.t);
        for (int axis = 0; axis < 3; ++axis) positions.push_back(std::clamp(p[axis], 0.0f, 1.0f));
        dt.push_back(sample.dt);
        ray_of.push_back(std::int64_t(r));
      }
      targets.push_back(observed.target.wanted());
      backgrounds.push_back(observed.target.background);
      directions.push_back(test::harmonics(observed.ray.direction.cast<double>()).to(torch::kFloat32));
    }
    positions_ = torch::tensor(positions).view({-1, 3});
    dt_ = torch::tensor(dt);
    ray_ = torch::tensor(ray_of);
    target_ = torch::tensor(targets);
    background_ = torch::tensor(backgrounds);
    directions_ = torch::stack(directions);
  }

  torch::Tensor features_at(const torch::Tensor& positions) const {
    return test::run_layers(density_layers_, test::encode_by_index_select(levels_, table_, positions));
  }
  torch::Tensor optical_depth(const torch::Tensor& features, const torch::Tensor& dt) const {
    const double scale = std::ldexp(1.0, options_.cascades - 1);
    return features.select(1, 0).clamp(-15, 15).exp() * dt * scale;
  }
  struct Walk {
    torch::Tensor of_ray;          ///< [R] f64 optical depth of whole rays
    torch::Tensor before, behind;  ///< [N] f64 transmittance in front of and behind each sample
  };
  /// Rays lie behind one another: a sum over all of them, less what the rays before add up to. Doubles, for it is long.
  Walk walk(const torch::Tensor& depth, const torch::Tensor& ray) const {
    const torch::Tensor deep = depth.to(torch::kFloat64);
    const torch::Tensor of_ray = torch::zeros({target_.size(0)}, torch::kFloat64).index_add(0, ray, deep);
    const torch::Tensor sum = deep.cumsum(0) - (of_ray.cumsum(0) - of_ray).index_select(0, ray);
    return {of_ray, torch::exp(deep - sum), torch::exp(-sum)};
  }

  /// @param[out] trained  samples in front of the point where their ray becomes opaque
  torch::Tensor loss(std::int64_t& trained) const {
    torch::Tensor kept;
    {
      const torch::NoGradGuard density_first;
      kept = (walk(optical_depth(features_at(positions_), dt_), ray_).before >= kTrainingTransmittance).nonzero();
      kept = kept.squeeze(1);
    }
    trained = kept.numel();
    const torch::Tensor ray = ray_.index_select(0, kept);
    const torch::Tensor features = features_at(positions_.index_select(0, kept));
    const torch::Tensor directions = directions_.index_select(0, ray);
    const torch::Tensor raw = test::run_layers(luminance_layers_, torch::cat({features, directions}, 1)).select(1, 0);
    const Walk through = walk(optical_depth(features, dt_.index_select(0, kept)), ray);
    const torch::Tensor light =
        (through.before - through.behind).to(torch::kFloat32) * test::luminance_activation(raw, options_.max_luminance);
    const torch::Tensor seen = torch::zeros_like(target_).index_add(0, ray, light) +
                               torch::exp(-through.of_ray).to(torch::kFloat32) * background_;
    return ((test::lightness(seen) - test::lightness(target_)) / 100).square().mean();
  }

  LuminanceEngine& engine_;
  const LuminanceEngineOptions& options_;
  std::vector<GridLevel> levels_;
  test::Stage1Gradients wanted_;
  torch::Tensor positions_, dt_, ray_, target_, background_, directions_, table_;
  std::vector<torch::Tensor> density_layers_, luminance_layers_;
  std::unique_ptr<torch::optim::Adam> adam_;
};

void report(benchmark::State& state, double seconds_a_sample, int threads) {
  state.counters["ns_a_sample"] = 1e9 * seconds_a_sample;
  state.counters["M_samples_s"] = 1e-6 / seconds_a_sample;
  state.counters["threads"] = threads;
  state.SetLabel(to_string(active_isa()));
}

/// Rounds of either kind in turn, so that what else the machine does falls on all alike; the best round counts.
void WholeStep(benchmark::State& state, const Capture& capture, IsaLevel isa, int threads) {
  const test::ScopedIsa scope(isa);
  Training training(capture, plain_options());
  torch::set_num_threads(threads);
  TorchStep torch_step(training);
  torch_step.verify();
  while (state.KeepRunning()) {
    double all = 1e30, one = 1e30, torch_best = 1e30;
    for (int i = 0; i < kRounds; ++i) {
      all = std::min(all, engine_seconds(training, threads));
      one = std::min(one, engine_seconds(training, 1));
      if (i % 4 == 0) {
        double samples = 0;
        const double seconds = bench::best_seconds(1, [&] { samples = torch_step.step(); });
        torch_best = std::min(torch_best, seconds / samples);
      }
    }
    report(state, all, threads);
    state.counters["one_thread_ns"] = 1e9 * one;
    state.counters["against_one_thread"] = one / all;
    state.counters["libtorch_ns"] = 1e9 * torch_best;
    state.counters["against_libtorch"] = torch_best / all;
  }
}

/// As a training runs it.
void DefaultStep(benchmark::State& state, const Capture& capture, int threads) {
  Training training(capture, {});
  while (state.KeepRunning()) {
    double best = 1e30;
    for (int i = 0; i < kRounds; ++i) best = std::min(best, engine_seconds(training, threads));
    report(state, best, threads);
  }
}

void register_steps(const Capture& capture, int threads) {
  const auto add = [](const std::string& name, const auto& step) {
    benchmark::RegisterBenchmark(name.c_str(), step)->Iterations(1)->Unit(benchmark::kMillisecond);
  };
  const auto whole = [&](IsaLevel isa) {
    return [&capture, isa, threads](benchmark::State& state) { WholeStep(state, capture, isa, threads); };
  };
  add("WholeStep", whole(std::min(active_isa(), IsaLevel::kAvx512)));
  if (active_isa() == IsaLevel::kAvx512Bf16) add("WholeStep/bf16", whole(IsaLevel::kAvx512Bf16));
  add("WholeStep/default", [&capture, threads](benchmark::State& state) { DefaultStep(state, capture, threads); });
}

}  // namespace
}  // namespace cnerf

int main(int argc, char** argv) {
  CLI::App app("A whole step of stage 1 against LibTorch's autograd.");
  app.allow_extras();
  std::filesystem::path capture;
  int downscale = 2, threads = 2;
  app.add_option("capture", capture, "folder of a capture")->required();
  app.add_option("--downscale", downscale, "of its images");
  app.add_option("--threads", threads, "of the engine and of LibTorch");
  CLI11_PARSE(app, argc, argv);
  const cnerf::Capture photographs = cnerf::load_capture(capture, {.downscale = downscale, .holdout = 8});
  cnerf::register_steps(photographs, threads);
  int rest_count = 1;
  std::vector<std::string> rest = app.remaining();
  std::vector<char*> rest_arguments = {argv[0]};
  for (std::string& argument : rest) rest_arguments.push_back(argument.data()), ++rest_count;
  benchmark::Initialize(&rest_count, rest_arguments.data());
  benchmark::RunSpecifiedBenchmarks();
}
