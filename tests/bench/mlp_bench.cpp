// The two small nets of stage 1, forward and backward, against the multiply-add rate measured in the same run; with
// bf16 products where the processor has them, against the rate of those. One thread.

#include <benchmark/benchmark.h>
#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "src/base/cpu_features.h"
#include "src/field/cpu/mlp.h"
#include "tests/bench/bench_support.h"
#include "tests/support/grouped.h"
#include "tests/support/isa.h"
#include "tests/support/mlp_reference.h"

namespace cnerf {
namespace {

constexpr std::size_t kGroups = 64;  // a block of rays: its activations fit L2, as in training
constexpr int kRepeats = 40;

/// Twelve independent chains of multiply-adds.
using Vector8 = float __attribute__((vector_size(32)));
using Vector16 = float __attribute__((vector_size(64)));
__attribute__((target("avx2,fma"))) void chains_avx2(long rounds) {
  Vector8 chain[12];
  for (int c = 0; c < 12; ++c) chain[c] = Vector8{} + 1.0f + 0.01f * float(c);
  const Vector8 factor = Vector8{} + 0.999f, term = Vector8{} + 0.001f;
  for (long i = 0; i < rounds; ++i) {
    for (auto& value : chain) value = value * factor + term;
  }
  for (auto& value : chain) benchmark::DoNotOptimize(value);
}
__attribute__((target("avx512f"))) void chains_avx512(long rounds) {
  Vector16 chain[12];
  for (int c = 0; c < 12; ++c) chain[c] = Vector16{} + 1.0f + 0.01f * float(c);
  const Vector16 factor = Vector16{} + 0.999f, term = Vector16{} + 0.001f;
  for (long i = 0; i < rounds; ++i) {
    for (auto& value : chain) value = value * factor + term;
  }
  for (auto& value : chain) benchmark::DoNotOptimize(value);
}

/// Each instruction adds 32 products to 16 floats.
__attribute__((target("avx512bf16,avx512vl,avx512bw"))) void chains_bf16(long rounds) {
  __m512 chain[12] = {};
  __m512i pairs = _mm512_set1_epi32(0x3f803f80);  // ones
  for (long i = 0; i < rounds; ++i) {
    for (__m512& value : chain) value = _mm512_dpbf16_ps(value, __m512bh(pairs), __m512bh(pairs));
    benchmark::DoNotOptimize(pairs);
  }
  for (__m512& value : chain) benchmark::DoNotOptimize(value);
}

/// Floating-point operations a second of one thread.
double peak_rate() {
  constexpr long kRounds = 2'000'000;
  struct Chains {
    void (*run)(long);
    int products;
  };
  const IsaLevel isa = active_isa();
  if (isa == IsaLevel::kGeneric) return NAN;
  const Chains chains = isa == IsaLevel::kAvx2     ? Chains{chains_avx2, 8}
                        : isa == IsaLevel::kAvx512 ? Chains{chains_avx512, 16}
                                                   : Chains{chains_bf16, 32};
  const double seconds = bench::best_seconds(7, [&] { chains.run(kRounds); });
  return 2.0 * 12 * chains.products * double(kRounds) / seconds;
}

/// A net with activations and gradients for a block of samples.
struct NetAtWork {
  explicit NetAtWork(const MlpLayout& layout) : net(layout, 1, 1) {
    for (const int width : layout.widths) {
      values.emplace_back(kGroups * std::size_t(width) * kGroup, 0.25f);
      slopes.emplace_back(kGroups * std::size_t(width) * kGroup, 0.01f);
    }
    for (std::size_t i = 0; i < values.size(); ++i) {
      activations.push_back({values[i].data(), layout.widths[i]});
      gradients.push_back({slopes[i].data(), layout.widths[i]});
    }
    d_weights.assign(layout.weight_count(), 0.0f);
  }
  void verify() {
    net.forward(activations, kGroups);
    const MlpReference<double> reference = {net.layout(), {net.weights().begin(), net.weights().end()}};
    const auto wanted = reference.forward(std::vector<double>(std::size_t(net.layout().inputs()), 0.25)).back();
    for (std::size_t o = 0; o < wanted.size(); ++o) {
      const double bound = active_isa() == IsaLevel::kAvx512Bf16 ? 1e-2 : 1e-4;
      bench::require(std::abs(values.back()[o * kGroup] - wanted[o]) < bound, "the net differs from the reference");
    }
  }
  void step() {
    net.forward(activations, kGroups);
    net.backward(activations, gradients, kGroups, d_weights.data());
  }

  MlpCpu net;
  std::vector<AlignedVector<float>> values, slopes;
  std::vector<Channels> activations, gradients;
  std::vector<float> d_weights;
};

void ForwardAndBackward(benchmark::State& state, const MlpLayout& layout, IsaLevel isa) {
  const test::ScopedIsa scope(isa);
  NetAtWork work(layout);
  work.verify();
  const double samples = double(kGroups * kGroup);
  while (state.KeepRunning()) {
    const double peak = peak_rate();
    const double seconds = bench::best_seconds(kRepeats, [&] { work.step(); });
    const double operations =
        3 * 2.0 * double(layout.weight_count()) * samples;  // forward, inputs', weights' gradients
    state.counters["ns_a_sample"] = 1e9 * seconds / samples;
    state.counters["GFLOP_s"] = 1e-9 * operations / seconds;
    state.counters["peak_GFLOP_s"] = 1e-9 * peak;
    state.counters["share_of_peak"] = operations / seconds / peak;
    state.SetLabel(to_string(active_isa()));
  }
}

void register_net(const std::string& name, const MlpLayout& layout) {
  const auto add = [&](const std::string& full_name, IsaLevel isa) {
    benchmark::RegisterBenchmark(full_name.c_str(), ForwardAndBackward, layout, isa)
        ->Iterations(1)
        ->Unit(benchmark::kMillisecond);
  };
  add("ForwardAndBackward/" + name, std::min(active_isa(), IsaLevel::kAvx512));
  if (active_isa() == IsaLevel::kAvx512Bf16) add("ForwardAndBackward/" + name + "/bf16", IsaLevel::kAvx512Bf16);
}

}  // namespace
}  // namespace cnerf

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  cnerf::register_net("density_net", {{32, 64, 16}});
  cnerf::register_net("luminance_net", {{32, 64, 64, 4}});
  benchmark::RunSpecifiedBenchmarks();
}
