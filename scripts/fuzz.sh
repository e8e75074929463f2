#!/usr/bin/env bash
# scripts/fuzz.sh [SECONDS] [NAME...]: builds the fuzz targets of tests/fuzz with clang and runs each, or those named,
# so many seconds (60), as many at a time as there are cores or $JOBS says. They begin with the inputs of
# tests/fuzz/corpus and with what earlier runs found, which lies in build/fuzz/corpus. Ends with 1 on a finding, whose
# input it names, and where a target was not built or not run.
set -euo pipefail
cd "$(dirname "$0")/.."
build=build/fuzz
seconds=60
if [[ ${1-} =~ ^[0-9]+$ ]]; then
  seconds=$1
  shift
fi
jobs=${JOBS:-$(nproc)}

mkdir -p build
cmake --preset fuzz > "$build.configure.log" 2>&1 || { cat "$build.configure.log"; exit 1; }
names=("$@")
if [ ${#names[@]} = 0 ]; then mapfile -t names < "$build/tests/fuzz/targets.txt"; fi
# What does not build is found below: the others run all the same.
nice -n 5 cmake --build --preset fuzz -j "$jobs" --target "${names[@]/#/fuzz_}" -- -k 0 ||
  echo "fuzz.sh: not everything was built"

# What a target gets besides its inputs: the most bytes of one, and its words.
max_len() {
  case $1 in
    colorizer_weights | exr | image | stage1_snapshot | take_snapshot | vdb_file) echo 16384 ;;
    http) echo 4096 ;;
    exif | gzip | network_contract | tensor_file | vdb_answer | cluster_message | known_colors | bake_journal | spike_stream | onnx) echo 2048 ;;
    *) echo 8192 ;;
  esac
}
dictionary() {
  case $1 in
    transforms | run_record | take_record | bake_manifest | path_file | stage1_snapshot | take_snapshot | shown_bundle | vdb_answer) echo json ;;
    strokes | known_colors | studio_message | layers_model) echo json ;;
    photogrammetry) echo cameras ;;
    cluster_message) echo launch ;;
    config | network_contract) echo toml ;;
    poses_bounds) echo npy ;;
    http) echo http ;;
    exr) echo exr ;;
    image | exif) echo image ;;
    colmap_text | capture_folder) echo colmap ;;
  esac
}

scratch=$(mktemp -d "$([ -d /dev/shm ] && echo /dev/shm || echo "${TMPDIR:-/tmp}")/cnerf-fuzz-XXXXXX")
trap 'rm -rf "$scratch"' EXIT
run() {  # run NAME: leaves NAME.log and NAME.status in $build/logs
  local name=$1 status=0 words
  words=$(dictionary "$name")
  mkdir -p "$build/corpus/$name" "$build/findings/$name" "$scratch/$name"
  rm -f "$build/findings/$name"/*
  TMPDIR=$scratch/$name ASAN_OPTIONS=detect_stack_use_after_return=0 UBSAN_OPTIONS=print_stacktrace=1 \
    timeout --kill-after=10 $((seconds + 120)) "$build/tests/fuzz/fuzz_$name" \
    -max_total_time="$seconds" -max_len="$(max_len "$name")" -rss_limit_mb=2048 -timeout=10 -print_final_stats=1 \
    -artifact_prefix="$build/findings/$name/" ${words:+-dict=tests/fuzz/dictionaries/$words.dict} \
    "$build/corpus/$name" "tests/fuzz/corpus/$name" > "$build/logs/$name.log" 2>&1 || status=$?
  echo "$status" > "$build/logs/$name.status"
}
mkdir -p "$build/logs"
rm -f "$build/logs"/*
for name in "${names[@]}"; do
  # One of an earlier build is not run for what does not build any more.
  ninja -C "$build" "fuzz_$name" > /dev/null 2>&1 || continue
  while [ "$(jobs -rp | wc -l)" -ge "$jobs" ]; do wait -n || true; done
  run "$name" &
done
wait

failures=0 runs_of_all=0
fail() {
  failures=$((failures + 1))
  problems+=("$1: $2")
}
problems=()
printf '%-20s %12s %8s %9s\n' target runs edges findings
for name in "${names[@]}"; do
  log=$build/logs/$name.log
  if [ ! -f "$build/logs/$name.status" ]; then
    fail "$name" "was not built"
    printf '%-20s %12s %8s %9s\n' "$name" - - 'not built'
    continue
  fi
  runs=$(sed -nE 's/^stat::number_of_executed_units: +([0-9]+)$/\1/p' "$log" | tail -1)
  if [ -z "$runs" ]; then runs=$(sed -nE 's/^#([0-9]+).*/\1/p' "$log" | tail -1); fi
  edges=$(sed -nE 's/^#[0-9]+.* cov: ([0-9]+) .*/\1/p' "$log" | tail -1)
  mapfile -t found < <(find "$build/findings/$name" -type f ! -name 'slow-unit-*' | sort)
  runs_of_all=$((runs_of_all + ${runs:-0}))
  printf '%-20s %12s %8s %9s\n' "$name" "${runs:-0}" "${edges:-0}" "${#found[@]}"
  status=$(cat "$build/logs/$name.status")
  for input in "${found[@]}"; do fail "$name" "$input; what it says is in $log"; done
  if [ ${#found[@]} = 0 ] && [ "$status" != 0 ]; then fail "$name" "ended with $status: see $log"; fi
  if [ "${runs:-0}" = 0 ] || [ "${edges:-0}" = 0 ]; then fail "$name" "did not run: see $log"; fi
done
printf '%-20s %12s\n' all "$runs_of_all"
for problem in "${problems[@]}"; do echo "$problem"; done
exit $((failures > 0))
