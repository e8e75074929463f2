// cnerf-cuda-check: benchmarks of the CUDA engine for a machine that has a GPU and a driver, and nothing else. Whether
// the engine is right is for cnerf-backend-ops to say.
//
//   cnerf-cuda-check bench  capture=FOLDER [steps=1000] [magnified=1] [option=value ...]
//   cnerf-cuda-check bench-stage2 capture=FOLDER [steps=3000] [rays=4096] [option=value ...]
//   cnerf-cuda-check train  capture=FOLDER [seconds=10] [seeds=1] [option=value ...]
//
// FOLDER is what pack_capture made; the frame that is timed has `magnified` times a view's width and height. Options:
// levels, log2_rows, coarsest, finest, samples, steps_per_box, cone, rate, final_rate.

#include <cstdio>
#include <exception>

#include "tests/cuda/check.h"

int main(int argc, char** argv) {
  const std::string command = argc > 1 ? argv[1] : "";
  const cnerf::test::Arguments arguments(argc, argv, 2);
  try {
    if (command == "bench") return cnerf::test::bench(arguments);
    if (command == "bench-stage2") return cnerf::test::bench_stage2(arguments);
    if (command == "train") return cnerf::test::train(arguments);
  } catch (const std::exception& failure) {
    std::fprintf(stderr, "%s\n", failure.what());
    return 1;
  }
  std::puts("cnerf-cuda-check bench capture=FOLDER | bench-stage2 capture=FOLDER | train capture=FOLDER");
  return 64;
}
