#!/usr/bin/env bash
# Runs every step of the program and hostile clients of its server under the thread sanitizer (preset tsan), with two
# threads. Fails where it reports a race; reports are kept.
#   bash scripts/threads.sh     about 10 minutes after the build
# FOLDER of everything, emptied before [build/threads]
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${FOLDER:-build/threads}
cmake --preset tsan > /dev/null
cmake --build --preset tsan --target cnerf cnerf-vdb-reader cnerf_torch cnerf_images cnerf_videos
cmake --build --preset release --target cnerf-server-campaign
rm -rf "$folder"
mkdir -p "$folder"
folder=$(realpath "$folder")
cnerf=$(realpath build/tsan/cnerf)
export CUDA_VISIBLE_DEVICES='' OMP_NUM_THREADS=2
export TSAN_OPTIONS="suppressions=$PWD/cmake/tsan.supp ignore_noninstrumented_modules=1 history_size=4 log_path=$folder/report"
options=(--threads 2)
for setting in stage1.steps=60 stage1.samples_per_step=4096 stage1.checkpoint_every=20 stage1.grid.log2_rows=12 \
  stage2.patches=6 stage2.patch_size=32 stage2.rays_per_patch=256 stage2.working_resolution=32 stage2.distill_steps=10 \
  colorizer.reference_steps=20 bake.resolution=32 web.resolution=32 render.frames=3 render.short_side=32 mesh.faces=500 \
  mesh.texture_size=256 mesh.surface_depth=64; do
  options+=(--set "$setting")
done
failures=0
step() {  # step NAME COMMAND...: with a line of the table
  local name=$1 begin=$SECONDS code=0
  shift
  "$@" > "$folder/said.txt" 2>&1 || code=$?
  local reports
  reports=$(cat "$folder"/report.* 2> /dev/null | grep -c 'WARNING: ThreadSanitizer' || true)
  echo "| $name | $code | $((reports - before)) | $((SECONDS - begin)) s |"
  if [ $code -ne 0 ] || [ "$reports" -ne "$before" ]; then failures=$((failures + 1)) && tail -n 3 "$folder/said.txt" >&2; fi
  before=$reports
}
before=0
run=$folder/run
echo "| step | exit code | reports | time |"
echo "|---|---|---|---|"
step sample "$cnerf" sample -o "$folder/capture" --views 6 --width 48 --height 36 --samples-per-pixel 1
step train "$cnerf" train "$folder/capture" -o "$run" "${options[@]}"
step "colorize, reference" "$cnerf" colorize "$run" --take t --colorizer reference:references "${options[@]}"
step "colorize, built in" "$cnerf" colorize "$run" --take b --colorizer builtin "${options[@]}"
for format in vdb web gltf exr splat; do
  step "bake, $format" "$cnerf" bake "$run" --take t --format $format -o "$folder/$format" "${options[@]}"
done
step eval "$cnerf" eval "$run" --take t "${options[@]}"
step render "$cnerf" render "$run" --take t "${options[@]}"
step run "$cnerf" run "$folder/capture" -o "$folder/whole" --colorizer reference:references "${options[@]}"
step "server, a training followed" build/release/tests/mutants/cnerf-server-campaign --sanitized --program "$cnerf" \
  --folder "$folder/server" --slow 50 --silent 50 --streams 50 --aborts 50 --garbage 500 --seconds 5 --patience 20
exit $((failures > 0))
