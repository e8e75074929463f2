# What the tests of launchers share.  source common.sh CNERF FOLDER
#   $CNERF_HAND  folder of hand.sh, which has the capture and the run by hand; without it a test makes its own
set -euo pipefail
cnerf=$(realpath "$1")
rm -rf "$2"
mkdir -p "$2"
work=$(realpath "$2")
export CUDA_VISIBLE_DEVICES=  # the same on every machine
export OMP_NUM_THREADS=1  # a colorizer's answers depend on LibTorch's threads, which launchers set differently

skip() {
  echo "skipped: $1"
  exit 77
}
fail() {
  echo "FAILED: $1" >&2
  exit 1
}
need() {
  local program
  for program in "$@"; do command -v "$program" > /dev/null || skip "there is no $program"; done
}

# A run that takes a few seconds, with a colorizer that learns something in the run's folder.
settings=()
for setting in stage1.steps=60 stage1.samples_per_step=4096 stage1.checkpoint_every=20 stage1.steps_per_box=64 \
  stage1.grid.levels=4 stage1.grid.log2_rows=12 stage1.grid.finest_resolution=64 stage2.patches=6 \
  stage2.patch_size=32 stage2.rays_per_patch=256 stage2.working_resolution=32 stage2.distill_steps=2 \
  stage2.colorizer_batch=2 stage2.grid.levels=4 stage2.grid.log2_rows=12 stage2.grid.finest_resolution=64 \
  stage2.purify.enabled=false stage2.purify.base_images=2 bake.resolution=32 render.frames=3 render.short_side=32 \
  render.steps_per_box=64; do
  settings+=(--set "$setting")
done
capture="${CNERF_HAND:-$work}/capture"
if [ -z "${CNERF_HAND:-}" ]; then
  "$cnerf" sample -o "$capture" --views 9 --width 48 --height 36 --samples-per-pixel 1 > "$work/sample.log"
elif [ ! -d "$capture" ] || [ ! -d "$CNERF_HAND/hand" ]; then
  fail "no capture and run by hand in $CNERF_HAND, where hand.sh makes them"
fi
# The words of a whole run to a folder.
run_words() { printf '%s\0' "$cnerf" run "$capture" -o "$1" --colorizer builtin "${settings[@]}"; }

free_port() { python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'; }

# Starts the words after it as one of two ranks that meet at HOST.  as_rank RANK HOST PORT WORDS
as_rank() {
  local rank=$1 host=$2 port=$3
  shift 3
  env RANK="$rank" WORLD_SIZE=2 LOCAL_RANK="$rank" LOCAL_WORLD_SIZE=2 MASTER_ADDR="$host" MASTER_PORT="$port" "$@"
}

# Two ranks on this machine's loopback, without any launcher.  by_hand OUT
by_hand() {
  if [ -n "${CNERF_HAND:-}" ]; then
    cp -r "$CNERF_HAND/hand" "$1"
    return
  fi
  local port words
  port=$(free_port)
  mapfile -d '' -t words < <(run_words "$1")
  as_rank 1 127.0.0.1 "$port" "${words[@]}" > "$1.rank1.log" 2>&1 &
  local other=$!
  as_rank 0 127.0.0.1 "$port" "${words[@]}" > "$1.log" 2>&1 || fail "rank 0: $(cat "$1.log")"
  wait "$other" || fail "rank 1: $(cat "$1.rank1.log")"
}

files_below() { (cd "$1" && find . -type f | LC_ALL=C sort); }

# The same files, and the same bits in those that hold neither times nor paths; a VDB file has a number of its own in its
# first 57 bytes.  same_run A B
same_run() {
  diff <(files_below "$1") <(files_below "$2") || fail "other files in $2 than in $1"
  local file
  for file in stage1.snapshot takes/builtin/take.snapshot takes/builtin/bases.png metrics.json contact_sheet.png \
    renders/builtin/turntable.mp4; do
    cmp "$1/$file" "$2/$file" || fail "$file differs between $1 and $2"
  done
  cmp -i 57 "$1/bakes/builtin/volume.vdb" "$2/bakes/builtin/volume.vdb" || fail "volumes of $1 and $2 differ"
}

# Waits until a command succeeds.  until_true SECONDS WHAT COMMAND
until_true() {
  local limit=$1 what=$2
  shift 2
  local end=$((SECONDS + limit))
  until "$@"; do
    if ((SECONDS > end)); then fail "$what: not within $limit s"; fi
    read -rt 0.05 <> <(:) || true
  done
}
