// How long a colorizer takes for the patches that stage 2 asks about, alone on the machine.
//   cnerf-colorizer-bench [SPEC] [PATCHES] [SIDE]     builtin, 16 patches per question, 128 pixels
//   prints milliseconds per patch: the quickest question and the median of fifteen, after three that warm up

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <vector>

#include "src/base/rng.h"
#include "src/base/statistics.h"
#include "src/base/usage.h"
#include "src/colorizer/colorizer.h"

namespace cnerf {
namespace {

/// Noise: what a network is shown does not change how long it takes.
LightnessBatch question(int patches, int side, std::uint64_t number) {
  SequentialRng random(named_stream("patches"), number);
  LightnessBatch batch{patches, side, side, {}};
  for (std::size_t i = 0; i < std::size_t(patches) * std::size_t(side) * std::size_t(side); ++i) {
    batch.lightness.push_back(100 * random.uniform());
  }
  for (int p = 0; p < patches; ++p) {
    PatchOrigin origin;
    origin.query = number * std::uint64_t(patches) + std::uint64_t(p);
    batch.origins.push_back(origin);
  }
  return batch;
}

int bench(int argc, char** argv) {
  ColorizerOptions options;
  options.spec = argc > 1 ? argv[1] : "builtin";
  const int patches = argc > 2 ? std::atoi(argv[2]) : 16, side = argc > 3 ? std::atoi(argv[3]) : 128;
  if (patches < 1 || side < 1) return std::puts("cnerf-colorizer-bench [SPEC] [PATCHES] [SIDE]"), 64;
  const auto colorizer = make_colorizer(options);
  std::vector<double> milliseconds;
  for (std::uint64_t number = 0; number < 18; ++number) {
    const LightnessBatch asked = question(patches, side, number);
    const Stopwatch watch;
    const ChromaBatch answer = colorizer->colorize(asked);
    if (number >= 3) milliseconds.push_back(1000 * watch.seconds() / patches);
    check_answer(colorizer->name(), asked, answer);
  }
  fmt::print("{}, {} patches of {}x{} per question: {:.2f} ms per patch, median {:.2f} ms\n", colorizer->name(),
             patches, side, side, quantile(milliseconds, 0), median(milliseconds));
  return 0;
}

}  // namespace
}  // namespace cnerf

int main(int argc, char** argv) {
  try {
    return cnerf::bench(argc, argv);
  } catch (const std::exception& e) {
    return std::fprintf(stderr, "cnerf-colorizer-bench: %s\n", e.what()), 1;
  }
}
