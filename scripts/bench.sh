#!/usr/bin/env bash
# Times the processor's hot paths, each verified against its reference first, and writes the table into
# docs/performance.md. Ceilings and yardsticks are measured in the same run. Wants a quiet machine.
#
#   scripts/bench.sh CAPTURE [threads]        CAPTURE: a real one, as fox with 1080x1920 images; threads: all
#   scripts/bench.sh run CAPTURE [...]        cnerf run as a whole: scripts/bench_run.py says the rest
set -euo pipefail
if [ $# -lt 1 ]; then
  sed -n '2,6p' "$0" >&2
  exit 64
fi
root=$(cd "$(dirname "$0")/.." && pwd)
if [ "$1" = run ]; then  # where it was called: what follows may name files from there
  exec python3 "$root/scripts/bench_run.py" --cnerf "$root/build/release/cnerf" "${@:2}"
fi
capture=$1
[ ! -e "$capture" ] || capture=$(realpath -- "$capture")
cd "$root"
threads=${2:-$(nproc)}
build=build/release/tests/bench
document=docs/performance.md
cmake --build --preset release --target hash_grid_bench mlp_bench step_bench

results=$(mktemp -d)
trap 'rm -rf "$results"' EXIT
"$build/hash_grid_bench" --benchmark_format=csv > "$results/1.csv"
"$build/mlp_bench" --benchmark_format=csv > "$results/2.csv"
"$build/step_bench" "$capture" --downscale 2 --threads "$threads" --benchmark_format=csv > "$results/3.csv"

# A row a benchmark; the counters that a file does not have stay empty.
table=$(
  echo "| path | ns per sample | M samples/s | ceiling, ns | share of the ceiling | share of FMA peak | threads | against one thread | LibTorch, ns | against LibTorch |"
  echo "|---|---|---|---|---|---|---|---|---|---|"
  awk '
    function value(name, digits) {
      return name in column && $column[name] != "" ? sprintf("%." digits "f", $column[name]) : ""
    }
    BEGIN { FS = "," }
    /^name,/ { delete column; for (i = 1; i <= NF; i++) { gsub(/"/, "", $i); column[$i] = i } next }
    /^"/ {
      name = $1; gsub(/"|\/iterations:1/, "", name)
      threads = value("threads", 0)
      print "| " name " | " value("ns_a_sample", 0) " | " value("M_samples_s", 2) " | " value("ceiling_ns", 0) " | " \
            value("share_of_ceiling", 2) " | " value("share_of_peak", 2) " | " (threads == "" ? 1 : threads) " | " \
            value("against_one_thread", 2) " | " value("libtorch_ns", 0) " | " value("against_libtorch", 1) " |"
    }' "$results"/*.csv
)
processor=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1)
isa=$(grep -o '"avx512bf16"\|"avx512"\|"avx2"\|"generic"' "$results/1.csv" | head -1 | tr -d '"')
{
  sed '/<!-- bench.sh -->/q' "$document"
  printf '\n%s, %s, kernels for %s; %s of `%s`.\n\n%s\n\n' "$processor" "$threads threads" "$isa" \
    "the whole step on half-size images" "$(basename "$capture")" "$table"
  sed -n '/<!-- end of bench.sh -->/,$p' "$document"
} > "$results/document"
cp "$results/document" "$document"
echo "$table"
