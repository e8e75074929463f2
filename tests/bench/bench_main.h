#pragma once
/// The main function of a bench: what it throws is said by the bench's name.

#include <fmt/format.h>

#include <cstdio>
#include <exception>

namespace cnerf {

inline int bench_main(const char* name, int (*bench)(int, char**), int argc, char** argv) {
  try {
    return bench(argc, argv);
  } catch (const std::exception& problem) {
    fmt::print(stderr, "{}: {}\n", name, problem.what());
    return 1;
  }
}

}  // namespace cnerf
