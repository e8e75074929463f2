#!/usr/bin/env bash
# Builds the program and the campaign of changed files, and runs it. Ends non-zero where the program did not stand one.
#   bash scripts/mutants.sh [--full] [--sanitized] [options of cnerf-mutants]
#     --full       about 10,000 mutants in place of 20 of each kind
#     --sanitized  the program of the dev preset, with the address and undefined-behaviour sanitizers
# What it finds lies in build/mutants, or build/mutants-sanitized: table.txt, accepted.txt and violations/.
set -euo pipefail
cd "$(dirname "$0")/.."
per_kind=20 preset=release options=()
while [ $# -gt 0 ]; do
  case $1 in
    --full) per_kind=240 ;;
    --sanitized) preset=dev ;;
    *) options+=("$1") ;;
  esac
  shift
done

configure() {  # configure PRESET: only where it was not; its options stay as they were chosen
  if [ ! -f "build/$1/build.ninja" ]; then cmake --preset "$1"; fi
}
configure release
cmake --build --preset release --target cnerf cnerf-vdb-reader cnerf_torch cnerf_images cnerf-mutants
folder=build/mutants
if [ $preset = dev ]; then
  configure dev
  cmake --build --preset dev --target cnerf cnerf-vdb-reader cnerf_torch cnerf_images
  folder=build/mutants-sanitized
  options=(--asan --seconds 120 "${options[@]}")
fi
exec build/release/tests/mutants/cnerf-mutants --program "build/$preset/cnerf" --folder "$folder" -j "$(nproc)" \
  --per-kind "$per_kind" "${options[@]}"
