#!/usr/bin/env bash
# Builds everything with warnings as errors and runs every test.
#   bash scripts/test.sh [ctest options]     e.g. -L unit, -R Config
set -euo pipefail
cd "$(dirname "$0")/.."

bash scripts/install_dependencies.sh --tests
cmake --preset release -DCNERF_TESTS=ON -DCNERF_WARNINGS_AS_ERRORS=ON
cmake --build --preset release
ctest --preset release "$@"
