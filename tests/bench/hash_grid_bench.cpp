// The hash grid's two kernels against what the memory system allows: the same address trace, replayed in the same run
// without any arithmetic. One thread.

#include <benchmark/benchmark.h>

#include <cmath>

#include "encoding/cpu/hash_grid_kernels.h"
#include "tests/bench/bench_support.h"
#include "tests/support/grouped.h"
#include "tests/support/hash_grid_reference.h"

namespace cnerf {
namespace {

constexpr std::size_t kSamples = 1 << 16;
constexpr int kRepeats = 15;

using Row = float __attribute__((vector_size(16)));

class HashGridTrace {
 public:
  explicit HashGridTrace(int log2_rows) {
    HashGridOptions options;
    options.log2_rows = log2_rows;
    levels_ = hash_grid_levels(options);
    positions_ = bench::positions_along_rays(kSamples, 1.0f / 512, 3);
    grouped_ = test::to_groups(positions_, 3);
    const std::size_t channels = 4 * levels_.size();
    encoded_.assign(kSamples * channels, 0.0f);
    d_encoded_.assign(kSamples * channels, 0.01f);
    SequentialRng rng(5, 2);
    table_.resize(4 * std::size_t(total_rows(levels_)));
    for (float& value : table_) value = rng.uniform(-1, 1);
    d_table_.assign(table_.size(), 0.0f);
    for (const GridLevel& level : levels_) {
      for (std::size_t i = 0; i < kSamples; ++i) {
        for_each_corner<std::uint32_t>(level, &positions_[3 * i], [&](std::uint32_t, std::uint32_t row, float) {
          trace_.push_back(level.first_row + row);
        });
      }
    }
    verify();
  }

  void encode() {
    hash_grid_kernels().encode(levels_.data(), levels_.size(), table_.data(), grouped_.data(), kSamples / kGroup,
                               encoded_.data(), int(4 * levels_.size()));
  }
  void scatter() {
    for (std::size_t l = 0; l < levels_.size(); ++l) {
      hash_grid_kernels().scatter_level(levels_[l], grouped_.data(), d_encoded_.data(), kSamples / kGroup,
                                        int(4 * levels_.size()), int(4 * l),
                                        d_table_.data() + 4 * std::size_t(levels_[l].first_row));
    }
  }
  /// Loads every row of the trace.
  void replay_gather() const {
    const Row* rows = reinterpret_cast<const Row*>(table_.data());
    Row sums[4] = {};
    for (std::size_t i = 0; i < trace_.size(); i += 4) {
      for (std::size_t j = 0; j < 4; ++j) sums[j] += rows[trace_[i + j]];
    }
    benchmark::DoNotOptimize(sums);
  }
  /// Reads, adds to and writes every row of the trace.
  void replay_scatter() {
    Row* rows = reinterpret_cast<Row*>(d_table_.data());
    const Row one = {1, 1, 1, 1};
    for (const std::uint32_t row : trace_) rows[row] += one;
    benchmark::ClobberMemory();
  }

 private:
  void verify() {
    const std::vector<double> table(table_.begin(), table_.end());
    const std::vector<double> some(positions_.begin(), positions_.begin() + 3 * 512);
    const std::vector<double> wanted = encode_reference(levels_, table, some);
    encode();
    const std::vector<float> found = test::from_groups(encoded_, int(4 * levels_.size()), 512);
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      bench::require(std::abs(found[i] - wanted[i]) < 2e-4, "the encoding differs from the reference");
    }
  }

  std::vector<GridLevel> levels_;
  std::vector<float> positions_;
  AlignedVector<float> grouped_, encoded_, d_encoded_, table_, d_table_;
  std::vector<std::uint32_t> trace_;
};

void report(benchmark::State& state, double seconds, double ceiling) {
  state.counters["ns_a_sample"] = 1e9 * seconds / double(kSamples);
  state.counters["M_samples_s"] = 1e-6 * double(kSamples) / seconds;
  state.counters["ceiling_ns"] = 1e9 * ceiling / double(kSamples);
  state.counters["share_of_ceiling"] = ceiling / seconds;
  state.SetLabel(to_string(active_isa()));
}

void HashGridForward(benchmark::State& state) {
  HashGridTrace trace(int(state.range(0)));
  while (state.KeepRunning()) {
    const double ceiling = bench::best_seconds(kRepeats, [&] { trace.replay_gather(); });
    report(state, bench::best_seconds(kRepeats, [&] { trace.encode(); }), ceiling);
  }
}
BENCHMARK(HashGridForward)->Arg(15)->Arg(17)->Iterations(1)->Unit(benchmark::kMillisecond);

void HashGridBackward(benchmark::State& state) {
  HashGridTrace trace(int(state.range(0)));
  while (state.KeepRunning()) {
    const double ceiling = bench::best_seconds(kRepeats, [&] { trace.replay_scatter(); });
    report(state, bench::best_seconds(kRepeats, [&] { trace.scatter(); }), ceiling);
  }
}
BENCHMARK(HashGridBackward)->Arg(15)->Arg(17)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace cnerf

BENCHMARK_MAIN();
