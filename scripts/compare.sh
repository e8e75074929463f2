#!/usr/bin/env bash
# The table of docs/evaluation.md: fox, flower and lego; eleven methods, three seeds.
#   bash scripts/compare.sh REPORT [simulated|builtin] [further options of `cnerf compare`]
# Captures and LPIPS weights are looked for in $CNERF_DATA (else ../shared/data), the program in $CNERF (else the
# release build). Where there are GPUs, mpirun starts as many processes as there are cells, which take the GPUs in turns:
# one cell alone does not keep a GPU busy. RANKS=n for another number of processes, LAUNCH="srun -n 9" for another way to
# start them. What is finished stays, so that the same command goes on after a stop; with --overwrite it begins again.
# SEEDS=n for other than three, TIMES=no to leave out the table of training times.
set -euo pipefail

usage() {
  sed -n '2,3p' "$0" >&2
  exit 64
}
report=${1:-}
[ -n "$report" ] || usage
case ${2:-} in
  simulated | builtin) colorizer=$2; shift 2 ;;
  '' | -*) colorizer=simulated; shift ;;
  *) usage ;;
esac
root=$(cd "$(dirname "$0")/.." && pwd)
data=${CNERF_DATA:-$root/../shared/data}
cnerf=${CNERF:-$root/build/release/cnerf}
seeds=${SEEDS:-3}
captures=("$data/scenes/fox@4" "$data/scenes/flower@8" "$data/scenes/lego")
settings=(--config "$root/configs/compare.toml" --lpips-weights "$data/lpips/lpips_alex_f32.bin" --progress plain)
if [ "$colorizer" = builtin ]; then settings+=(--colorizer builtin); fi
colors=colornerf,colornerf-paper,without-purification,without-classification,colorize-then-fuse,video-then-fuse
colors+=,multi-scale-teacher,key-view-distilled,style-transfer,grey,oracle
if [ -z "${CUDA_VISIBLE_DEVICES+set}" ]; then
  # Without a GPU it prints why, where its answer would stand.
  if gpus=$(nvidia-smi --query-gpu=index --format=csv,noheader 2> /dev/null); then
    CUDA_VISIBLE_DEVICES=$(paste -sd, <<< "$gpus")
    export CUDA_VISIBLE_DEVICES
  fi
fi
ranks=${RANKS:-1}
if [ -n "${CUDA_VISIBLE_DEVICES:-}" ] && command -v mpirun > /dev/null; then
  ranks=${RANKS:-$((${#captures[@]} * seeds))}
fi

# The first call overwrites, if that is wanted; the next ones go on with what it made.
options=("$@")
going_on=(--resume)
case " $* " in *" --overwrite "*) going_on=() ;; esac
drop_overwrite() {
  local option all=("${options[@]}")
  options=()
  going_on=(--resume)
  for option in "${all[@]}"; do [ "$option" = --overwrite ] || options+=("$option"); done
}

# compare RANKS options: `cnerf compare` on all captures.
compare() {
  local launch=() count=$1
  shift
  if [ -n "${LAUNCH:-}" ]; then
    read -ra launch <<< "$LAUNCH"
  elif [ "$count" -gt 1 ]; then
    launch=(mpirun -np "$count" --bind-to none)
  fi
  "${launch[@]}" "$cnerf" compare "${captures[@]}" -o "$report" "${settings[@]}" "${going_on[@]}" "$@"
}

# Training times are taken while nothing else runs: two methods, one seed.
if [ "$colorizer" = simulated ] && [ "${TIMES:-yes}" = yes ]; then
  LAUNCH='' compare 1 --methods colornerf,positional-encoding "${options[@]}"
  drop_overwrite
fi
compare "$ranks" --methods $colors --seeds "$seeds" "${options[@]}"
drop_overwrite
"$cnerf" compare "${captures[@]}" -o "$report" "${settings[@]}" --methods all --seeds "$seeds" --only-report \
  --rating-sheet "${going_on[@]}" "${options[@]}"
