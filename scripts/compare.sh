#!/usr/bin/env bash
# The table of docs/evaluation.md: fox, flower and lego; eleven methods, three seeds.
#   bash scripts/compare.sh REPORT [simulated|builtin] [further options of `cnerf compare`]
# Captures and LPIPS weights are looked for in $CNERF_DATA (else ../shared/data), the program in $CNERF (else the
# release build). Trains on the GPUs there are. Parts run side by side, each on a capture and a seed; what is
# finished stays, so that the same command goes on after a stop. SEEDS=n for other than three, TIMES=no to leave out the
# table of training times.
set -euo pipefail

report=$1
colorizer=${2:-simulated}
shift $(($# > 1 ? 2 : 1))
root=$(cd "$(dirname "$0")/.." && pwd)
data=${CNERF_DATA:-$root/../shared/data}
cnerf=${CNERF:-$root/build/release/cnerf}
seeds=${SEEDS:-3}
captures=("$data/scenes/fox@4" "$data/scenes/flower@8" "$data/scenes/lego")
settings=(--config "$root/configs/compare.toml" --lpips-weights "$data/lpips/lpips_alex_f32.bin" --resume --progress plain)
if [ "$colorizer" = builtin ]; then settings+=(--colorizer builtin); fi
colors=colornerf,colornerf-paper,without-purification,without-classification,colorize-then-fuse,video-then-fuse
colors+=,multi-scale-teacher,key-view-distilled,style-transfer,grey,oracle
mkdir -p "$report/runs" "$report/logs"
# The GPUs that may be used, one a line.
if [ -n "${CUDA_VISIBLE_DEVICES+set}" ]; then
  mapfile -t gpus < <(tr ',' '\n' <<< "$CUDA_VISIBLE_DEVICES")
else
  mapfile -t gpus < <(nvidia-smi --query-gpu=index --format=csv,noheader 2> /dev/null || true)
fi

# Runs `cnerf compare` on one capture in the background; its words go to a file.  part NAME CAPTURE options
# Parts take the GPUs in turns.
parts=()
part() {
  local name=$1 capture=$2
  shift 2
  local device=()
  if [ ${#gpus[@]} -gt 1 ]; then device=("CUDA_VISIBLE_DEVICES=${gpus[$((${#parts[@]} % ${#gpus[@]}))]}"); fi
  env "${device[@]}" "$cnerf" compare "$capture" -o "$report" "${settings[@]}" "$@" > "$report/logs/$name.log" 2>&1 &
  parts+=($!)
}
# Waits for all parts; says which of them failed.
join() {
  local status=0
  for pid in "${parts[@]}"; do wait "$pid" || status=$?; done
  parts=()
  if [ $status -ne 0 ]; then
    tail -n 3 "$report"/logs/*.log >&2
    exit $status
  fi
}

# Training times are taken while little else runs: two methods, one seed.
if [ "$colorizer" = simulated ] && [ "${TIMES:-yes}" = yes ]; then
  for capture in "${captures[@]}"; do
    name=$(basename "${capture%@*}")
    part "times-$name" "$capture" --methods colornerf,positional-encoding "$@"
  done
  join
fi
# Threads are shared out among the parts.
share=$(($(nproc) / (${#captures[@]} * seeds)))
for capture in "${captures[@]}"; do
  for ((seed = 1; seed <= seeds; ++seed)); do
    part "$(basename "${capture%@*}")-$seed" "$capture" --methods $colors --first-seed "$seed" \
      --threads $((share > 1 ? share : 2)) "$@"
  done
done
join
"$cnerf" compare "${captures[@]}" -o "$report" "${settings[@]}" --methods all --seeds "$seeds" --only-report \
  --rating-sheet "$@"
