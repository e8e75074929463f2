#!/usr/bin/env bash
# Builds everything with warnings as errors and runs every test.
#   bash scripts/test.sh [ctest options]     e.g. -L unit, -R Config
set -euo pipefail
cd "$(dirname "$0")/.."

bash scripts/install_dependencies.sh --tests
cuda=OFF
if command -v nvcc > /dev/null; then cuda=ON; fi  # compiled wherever it can be; running it needs a GPU
cmake --preset release -DCNERF_TESTS=ON -DCNERF_WARNINGS_AS_ERRORS=ON -DCNERF_CUDA=$cuda -DCNERF_VIEWER=ON \
      -DCMAKE_CUDA_ARCHITECTURES="80-virtual;90"
cmake --build --preset release
ctest --preset release "$@"
