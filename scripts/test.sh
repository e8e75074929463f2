#!/usr/bin/env bash
# Builds everything and runs every test.
#   bash scripts/test.sh [ctest options]     e.g. -L smoke, -L unit, -R Config
# Ends with CTest's summary, where a test is a suite; the number of cases and why some were skipped stand before it.
# BUILD=no runs the tests of what is built; TARGETS="one two" builds these alone, for tests of them. WERROR=ON makes warnings
# errors, as continuous integration has it, and compiles anew what was built without.
set -euo pipefail
cd "$(dirname "$0")/.."
build=build/release

if [ "${BUILD:-yes}" = yes ]; then
  bash scripts/install_dependencies.sh --tests
  cuda=OFF
  # Compiled wherever it can be, by an nvcc that knows C++20; running it needs a GPU.
  if nvcc --version 2> /dev/null | grep -E 'release (1[2-9]|[2-9][0-9])\.' > /dev/null; then cuda=ON; fi
  cmake --preset release -DCNERF_TESTS=ON -DCNERF_WARNINGS_AS_ERRORS="${WERROR:-OFF}" -DCNERF_CUDA="${CNERF_CUDA:-$cuda}" \
        -DCNERF_VIEWER=ON -DCMAKE_CUDA_ARCHITECTURES="80-virtual;90"
  read -ra targets <<< "${TARGETS:-all}"
  cmake --build --preset release --target "${targets[@]}"
fi

# The counts that tests/support/gtest_main.cpp leaves, in a file per suite.
rm -rf "$build/Testing/cases"
mkdir -p "$build/Testing/cases"
# One more at a time than there are cores: tests of several processes and of the studio wait much of their time.
ctest --preset release --parallel "$(($(nproc) + 1))" "$@" | awk -v folder="$build/Testing/cases" '
  /^[0-9]+% tests passed/ {
    while ((("cat " folder "/* 2>/dev/null") | getline line) > 0) {
      split(line, word, " ")
      if (word[1] == "cases") { passed += word[2]; skipped += word[3]; failed += word[4] }
      else print line
    }
    printf "cases: %d passed, %d skipped, %d failed\n", passed, skipped, failed
  }
  { print; fflush() }'
