// cnerf-shared-check: stage 1 on the GPUs of several processes, for a machine that has them and a channel with NCCL.
//
//   torchrun --no-python --nproc-per-node 2 cnerf-shared-check capture=FOLDER [steps=1000] [option=value ...]
//
// FOLDER is what pack_capture made; options are those of cnerf-cuda-check. Started alone it measures one GPU. Prints
// how far the gradients of a step that is shared are from those of one that is not, whether all ranks hold the same
// field, how long a step takes, and how good the field is. With `enlarge=N copies=M` training views are N times as wide
// and high, and M times as many; `image_memory=MIB` bounds what of them lies on the GPU. `exchange=0` leaves out what
// the GPUs exchange, which is how long a step would take if that took no time; started alone, it plays one of two.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <span>

#include "src/cluster/ranks.h"
#include "src/train/luminance/shared_steps.h"
#include "tests/cuda/check.h"
#include "tests/cuda/packed_capture.h"
#include "tests/support/engine_state.h"
#include "tests/support/held_out_views.h"

namespace cnerf::test {
namespace {

/// More and larger photographs than there are.
void enlarge(Capture& capture, int times, int copies) {
  std::vector<View> views;
  for (const View& view : capture.views) {
    if (view.held_out) {
      views.push_back(view);
      continue;
    }
    View large = view;
    const MonoImage& from = view.image;
    MonoImage& to = large.image;
    to.width *= times;
    to.height *= times;
    large.intrinsics = resized(view.intrinsics, to.width, to.height);
    std::vector<std::uint8_t> pixels(to.pixel_count());
    for (std::size_t p = 0; p < pixels.size(); ++p) {
      const std::size_t x = p % std::size_t(to.width), y = p / std::size_t(to.width);
      pixels[p] = from.u8[y / std::size_t(times) * std::size_t(from.width) + x / std::size_t(times)];
    }
    to.u8 = std::move(pixels);
    for (int copy = 0; copy < copies; ++copy) views.push_back(large);
  }
  capture.views = std::move(views);
}

class NoExchange final : public DeviceSums {
 public:
  void sum(std::span<float>, void*) override {}
  void sum(std::span<double>, void*) override {}
  void sum_own_piece(std::span<Bfloat16>, void*) override {}
  void hand_round(std::span<std::byte>, void*) override {}
};

double distance(const std::vector<float>& found, const std::vector<float>& expected) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    difference += std::pow(double(found[i]) - double(expected[i]), 2);
    size += std::pow(double(expected[i]), 2);
  }
  return std::sqrt(difference / std::max(size, 1e-300));
}

std::uint64_t hash_of(LuminanceEngine& engine) {
  std::uint64_t hash = 14695981039346656037ULL;  // FNV-1a
  for (const StatePiece& piece : engine.state()) {
    if (piece.name == "occupancy") continue;  // its means are sums in an order that varies
    for (const std::byte byte : piece.bytes) hash = (hash ^ std::uint64_t(byte)) * 1099511628211ULL;
  }
  return hash;
}

/// By all ranks, whose engines are equal.
void compare_gradients(LuminanceEngine& engine, cluster::Ranks& ranks) {
  const Stage1Gradients shared = gradients_of_next_step(engine);
  engine.share_steps({});
  const Stage1Gradients alone = gradients_of_next_step(engine), again = gradients_of_next_step(engine);
  engine.share_steps(share_of(ranks));
  if (!ranks.is_first()) return;
  std::printf("samples %zu and %zu, loss %.7f and %.7f\n", shared.report.trained_samples, alone.report.trained_samples,
              shared.report.loss, alone.report.loss);
  std::printf("gradients, shared from alone: table %.2e, nets %.2e; alone from alone: table %.2e, nets %.2e\n",
              distance(shared.table, alone.table), distance(shared.weights, alone.weights),
              distance(again.table, alone.table), distance(again.weights, alone.weights));
}

int check_shared(const Arguments& arguments) {
  using Clock = std::chrono::steady_clock;
  cluster::Ranks& ranks = cluster::world();
  PackedCapture packed = read_packed(arguments.text("capture", "."));
  if (arguments.number("enlarge", 0) > 0) {
    enlarge(packed.capture, int(arguments.number("enlarge", 1)), int(arguments.number("copies", 1)));
  }
  const std::vector<TrainingView> views = training_views(packed.capture, packed.frame);
  LuminanceEngineOptions options = engine_options(arguments, packed.frame.cascades);
  if (arguments.number("poses", 0) > 0) options.learning = {int(views.size()), 0, true, true};
  const auto engine = make_cuda_luminance_engine(options);
  if (arguments.number("image_memory", 0) > 0) {
    engine->limit_image_memory(std::size_t(arguments.number("image_memory", 0)) << 20);
  }
  engine->set_views(views);
  StepShare share = share_of(ranks);
  NoExchange none;
  if (arguments.number("exchange", 1) == 0) {
    share = {ranks.rank(), std::max(2, ranks.size()), [](std::span<float>) {}, &none};
  }
  engine->share_steps(share);
  const int steps = int(arguments.number("steps", 1000));
  for (int i = 0; i < steps; ++i) engine->step(float(1e-2 * std::pow(0.05, std::max(0.0, 2.0 * i / steps - 1))));
  wait_for(*engine);

  constexpr int kTimed = 320;
  const auto start = Clock::now();
  double samples = 0, rays = 0;
  for (int i = 0; i < kTimed; ++i) {
    const StepReport report = engine->step(5e-4f);
    samples += double(report.trained_samples);
    rays += double(report.rays);
  }
  wait_for(*engine);
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  engine->complete_state();
  const std::uint64_t own = hash_of(*engine);
  double different = 0;
  if (!ranks.is_alone()) {
    for (const cluster::Bytes& bytes : ranks.gather(cluster::bytes_of(std::to_string(own)))) {
      if (cluster::text_of(bytes) != std::to_string(own)) different += 1;
    }
  }
  if (ranks.is_first()) {
    std::printf(
        "%d ranks: step %.3f ms = %.0f steps/s, %.0f samples of %.0f rays a step, %.1f M samples/s; %.0f ranks "
        "differ\n",
        ranks.size(), 1e3 * seconds / kTimed, kTimed / seconds, samples / kTimed, rays / kTimed,
        1e-6 * samples / seconds, different);
    double total = 0;
    const std::vector<HeldOutView> judged =
        Judge{packed.capture, packed.frame, *engine, options.march, {1e-3f}}.judge();
    for (const HeldOutView& view : judged) total += view.as_given;
    std::printf("held out after %ld steps: %.2f dB\n", engine->step_count(), total / double(judged.size()));
    std::fflush(stdout);
  }
  if (!ranks.is_alone() && share.on_device != &none) {
    ranks.barrier("pictures");
    compare_gradients(*engine, ranks);
  }
  return 0;
}

}  // namespace
}  // namespace cnerf::test

int main(int argc, char** argv) {
  try {
    cnerf::cluster::join_world();
    const int code = cnerf::test::check_shared(cnerf::test::Arguments(argc, argv, 1));
    std::fflush(stdout);
    cnerf::cluster::leave_world({});
    std::_Exit(code);  // threads of libraries may wait in the network
  } catch (const std::exception& failure) {
    std::fprintf(stderr, "%s\n", failure.what());
    cnerf::cluster::leave_world(failure.what());
    std::_Exit(1);
  }
}
