#!/usr/bin/env bash
# Uses the program for hours as people do, and worse: random captures and options, random kills and resumes, two programs
# at a time in one folder, a server that goes on all the time. Prints a table; ends non-zero where something was wrong.
#   bash scripts/soak.sh HOURS        0.1 is six minutes
# CNERF  the program [build/release/cnerf]     SEED  of the random choices [1]
# FOLDER of everything, emptied before [build/soak]     MEMORY  MiB a program may hold [1500]
# What fails is kept in $FOLDER/failed-ROUND.
set -uo pipefail
shopt -s extglob
cd "$(dirname "$0")/.."
hours=${1:?HOURS}
cnerf=$(realpath "${CNERF:-build/release/cnerf}")
folder=${FOLDER:-build/soak}
memory=${MEMORY:-1500}
RANDOM=${SEED:-1}
if [ ! -x /usr/bin/time ]; then echo "soak: needs GNU time (Debian: time)" >&2 && exit 69; fi
rm -rf "$folder"
mkdir -p "$folder/tmp" "$folder/page"
folder=$(realpath "$folder")
export TMPDIR=$folder/tmp CNERF_PAGE=$folder/page CUDA_VISIBLE_DEVICES=
echo '<!doctype html><title>page</title>' > "$folder/page/index.html"
end=$(($(date +%s) + $(awk -v h="$hours" 'BEGIN { printf "%d", h * 3600 }')))

# ---- counts ----------------------------------------------------------------------------------------------------------
declare -A calls ends peak
failures=() kills=0 resumes=0 pairs=0 rounds=0 results=0
count() { ends[$1]=$((${ends[$1]:-0} + 1)); }
fail() {
  local words=${*//--set [a-z]*([^ ])/}  # options are told by the seed
  set -- "$(tr -s ' ' <<< "$words")"
  failures+=("round $rounds: $*")
  echo "FAILED round $rounds: $*" >&2
  if [ -d "$folder/round" ] && [ ! -e "$folder/failed-$rounds" ]; then
    mkdir "$folder/failed-$rounds"
    cp -r "$folder/round" "$folder"/said.* "$folder/failed-$rounds"
    printf '%q ' "${options[@]}" > "$folder/failed-$rounds/options"
  fi
}

# documented COMMAND CODE SIGNAL: whether an end is one the program may have; SIGNAL is what was sent to it, or 0.
documented() {
  case $2 in
    0 | 64 | 65 | 66 | 69 | 71 | 73 | 75 | 76 | 77 | 78 | 79) return 0 ;;
    130) [ "$3" = INT ] || [ "$3" = TERM ] ;;
    137) [ "$3" = KILL ] ;;
    143) [ "$3" = TERM ] ;;
    *) return 1 ;;
  esac
}

# begin COMMAND...: starts the program beside us; its pid is GNU time's.
number=0
begin() {
  number=$((number + 1))
  /usr/bin/time -q -f %M -o "$folder/time.$number" "$cnerf" "$@" > "$folder/said.$number" 2>&1 &
  begun=$!
  calls[$1]=$((${calls[$1]:-0} + 1))
}
# finish PID NUMBER SIGNAL COMMAND...: waits; sets `code`.
finish() {
  local pid=$1 which=$2 signal=$3 kib
  shift 3
  wait "$pid"
  code=$?
  count "$1 $code"
  if ! documented "$1" $code "$signal"; then
    fail "exit code $code after signal $signal: $*: $(tail -n 2 "$folder/said.$which" | tr '\n' ' ')"
  fi
  kib=$(tail -n 1 "$folder/time.$which" 2> /dev/null)
  if [[ $kib =~ ^[0-9]+$ ]]; then
    if [ "$kib" -gt "${peak[$1]:-0}" ]; then peak[$1]=$kib; fi
    if [ "$kib" -gt $((memory * 1024)) ]; then fail "$((kib / 1024)) MiB held: $*"; fi
  fi
  rm -f "$folder/time.$which" "$folder/said.$which.old"
  last=$folder/said.$which
}
call() {  # call COMMAND...: to its end
  begin "$@"
  finish "$begun" $number 0 "$@"
}
# killed COMMAND...: sends a random signal after a random time; sets `code` and `signal`.
killed() {
  local child which
  signal=$(pick KILL INT TERM)
  begin "$@"
  which=$number
  sleep "0.$(printf %03d $((RANDOM % 900)))"
  child=$(pgrep -P "$begun" || true)
  if [ -n "$child" ] && kill -s "$signal" "$child" 2> /dev/null; then
    kills=$((kills + 1))
    # A signal that comes before the program listens is lost, and a server does not end by itself.
    while [ "$1" = view ] && sleep 0.5 && kill -s "$signal" "$child" 2> /dev/null; do :; done
  else
    signal=0  # it was faster
  fi
  finish "$begun" $which "$signal" "$@"
}
must() {  # must COMMAND...: its end has to be 0
  call "$@"
  if [ $code -ne 0 ]; then fail "exit code $code: $*: $(tail -n 2 "$last" | tr '\n' ' ')"; fi
}
pick() {
  local words=("$@")
  echo "${words[RANDOM % $#]}"
}
between() { echo $(($1 + RANDOM % ($2 - $1 + 1))); }

# ---- one round -------------------------------------------------------------------------------------------------------
random_options() {
  options=(--threads 1 --progress "$(pick quiet plain json line)" --device cpu)
  local setting
  for setting in "stage1.steps=$(between 60 400)" "stage1.samples_per_step=$(pick 1024 2048 4096)" \
    "stage1.checkpoint_every=$(between 1 50)" stage1.steps_per_box=32 "stage1.grid.levels=$(between 1 4)" \
    "stage1.grid.log2_rows=$(between 8 12)" stage1.grid.finest_resolution=32 colorizer.reference_steps=2 \
    "stage2.patches=$(between 1 12)" stage2.patch_size=16 stage2.rays_per_patch=64 stage2.working_resolution=32 \
    "stage2.distill_steps=$(between 1 20)" "stage2.colorizer_batch=$(between 1 4)" stage2.grid.levels=2 \
    stage2.grid.log2_rows=10 stage2.grid.finest_resolution=32 "stage2.purify.enabled=$(pick true false false)" \
    stage2.purify.base_images=2 web.resolution=16 "render.frames=$(between 1 4)" render.short_side=16 \
    render.steps_per_box=32 "bake.resolution=$(between 16 48)" "stage1.seed=$(between 1 99999)" mesh.texture_size=512 mesh.faces=500 mesh.surface_depth=64; do
    options+=(--set "$setting")
  done
}

# until_done COMMAND -- RESUMED-COMMAND: kills the first ones, then lets it end.
until_done() {
  local first=() again=() try
  while [ "$1" != -- ]; do first+=("$1") && shift; done
  shift
  again=("$@")
  killed "${first[@]}"
  for ((try = RANDOM % 3; try > 0 && code != 0; --try)); do
    resumes=$((resumes + 1))
    killed "${again[@]}"
  done
  if [ $code -ne 0 ]; then
    resumes=$((resumes + 1))
    must "${again[@]}"
  fi
}

two_at_once() {  # in one folder; the second may be told that it is busy
  local run=$1 a b first second format
  pairs=$((pairs + 1))
  case $((RANDOM % 3)) in
    0) a=(train "$capture" -o "$run" --resume "${options[@]}") b=("${a[@]}") ;;
    1) a=(bake "$run" --overwrite --resolution 24 "${options[@]}") b=(bake "$run" --overwrite --resolution 32 "${options[@]}") ;;
    2) a=(colorize "$run" --take twice --overwrite --colorizer grey "${options[@]}") b=("${a[@]}") ;;
  esac
  begin "${a[@]}"
  first=$begun format=$number
  begin "${b[@]}"
  second=$begun
  finish "$first" "$format" 0 "${a[@]}"
  finish "$second" $((format + 1)) 0 "${b[@]}"
}

opens() {  # opens FILE...: each final result
  local file
  for file in "$@"; do
    results=$((results + 1))
    must info "$file"
  done
}

round() {
  rounds=$((rounds + 1))
  capture=$folder/round/capture
  local run=$folder/round/run colorizer=grey left
  mkdir -p "$folder/round"
  random_options
  local views
  views=$(between 4 8)
  local sample=(sample -o "$capture" --views "$views" --width "$(between 16 40)" --height "$(between 16 32)"
    --samples-per-pixel 1 --threads 1)
  until_done "${sample[@]}" -- "${sample[@]}" --overwrite
  if [ $((RANDOM % 4)) -eq 0 ]; then
    until_done run "$capture" -o "$run" --grey "${options[@]}" -- run "$capture" -o "$run" --grey --resume "${options[@]}"
  else
    until_done train "$capture" -o "$run" "${options[@]}" -- train "$capture" -o "$run" --resume "${options[@]}"
  fi
  if [ $((RANDOM % 6)) -eq 0 ]; then colorizer=reference:$capture/color/view_001.png; fi
  if [ $((RANDOM % 10)) -eq 0 ]; then colorizer=builtin; fi
  until_done colorize "$run" --take a --colorizer "$colorizer" "${options[@]}" -- \
    colorize "$run" --take a --resume --colorizer "$colorizer" "${options[@]}"
  if [ $((RANDOM % 2)) -eq 0 ]; then two_at_once "$run"; fi
  local bake=(bake "$run" --take a --format "$(pick vdb vdb,web vdb,gltf web,vdb,gltf)" "${options[@]}")
  until_done "${bake[@]}" --overwrite -- "${bake[@]}" --overwrite
  killed view "$run" --take a --no-browser  # what it leaves is cleared by the next step
  call eval "$run" --take a "${options[@]}"
  call render "$run" --take a --path "$(pick turntable orbit spiral held-out)" --format "$(pick png exr png,exr)" \
    -o "$folder/round/pictures" "$(pick --baked --overwrite)" "${options[@]}"
  call render "$run/bakes/a" --path cameras -o "$folder/round/voxels"
  opens "$capture" "$run" "$run/stage1.snapshot" "$run/takes/a/take.snapshot" "$run/bakes/a/volume.vdb"
  visit
  left=$(find "$folder/round" -name '*.partial-*' | wc -l)
  if [ "$left" -gt 0 ]; then
    fail "$left unfinished files left: $(find "$folder/round" -name '*.partial-*' -printf '%P ' | head -c 200)"
  fi
  left=$(find "$folder/tmp" -mindepth 1 | wc -l)
  if [ "$left" -gt 0 ]; then fail "$left temporary files left"; fi
  rm -rf "$folder/round" "$folder"/said.* "$folder"/time.* "${folder:?}"/tmp/*
}

# ---- the server ------------------------------------------------------------------------------------------------------
start_server() {
  capture=$folder/shown/capture
  random_options
  must sample -o "$capture" --views 4 --width 24 --height 16 --samples-per-pixel 1
  must train "$capture" -o "$folder/shown/run" "${options[@]}"
  must bake "$folder/shown/run" --format web "${options[@]}"
  "$cnerf" view "$folder/shown/run" --no-browser > "$folder/server.txt" 2>&1 &
  server=$!
  local wait
  for ((wait = 0; wait < 300; ++wait)); do
    port=$(grep -oE '127\.0\.0\.1:[0-9]+' "$folder/server.txt" | head -n 1 | cut -d: -f2)
    if [ -n "$port" ]; then break; fi
    sleep 0.1
  done
  if [ -z "$port" ]; then echo "soak: the server does not start: $(cat "$folder/server.txt")" >&2 && exit 1; fi
  visit
  sleep 1
  server_kib=$(held) server_files=$(ls "/proc/$server/fd" | wc -l)
}
held() { awk '/^VmRSS/ { print $2 }' "/proc/$server/status"; }
visits=0
visit() {  # some requests, each with a connection of its own
  local i answer
  for ((i = 0; i < 20; ++i)); do
    visits=$((visits + 1))
    if exec 3<> "/dev/tcp/127.0.0.1/$port"; then
      printf 'GET /%s HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n' "$(pick '' bundle.json nothing)" >&3
      if ! IFS= read -r -t 10 answer <&3 || [[ $answer != HTTP/1.1\ [24]* ]]; then fail "the server answers '$answer'"; fi
      exec 3>&-
    else
      fail "the server cannot be reached"
    fi
  done
}

start_server
while [ "$(date +%s)" -lt $end ]; do round; done

sleep 6  # connections that wait are closed after 5 s
grown=$(($(held) - server_kib)) files=$(ls "/proc/$server/fd" | wc -l)
if [ $grown -gt 51200 ]; then fail "the server grew by $((grown / 1024)) MiB"; fi
if [ "$files" -gt "$server_files" ]; then fail "the server has $files descriptors, $server_files before"; fi
kill -INT "$server"
wait "$server"
code=$?
if [ $code -ne 0 ]; then fail "the server ended with $code"; fi

# ---- the table -------------------------------------------------------------------------------------------------------
printf '| command | calls | most MiB | ends |\n|---|---|---|---|\n'
for command in "${!calls[@]}"; do
  text=
  for each in "${!ends[@]}"; do
    if [ "${each% *}" = "$command" ]; then text+="${each##* }: ${ends[$each]}, "; fi
  done
  printf '| %s | %s | %s | %s |\n' "$command" "${calls[$command]}" "$((${peak[$command]:-0} / 1024))" "${text%, }"
done | sort
printf '\n%s rounds, %s kills, %s resumes, %s pairs, %s results opened, %s visits; server: %s KiB more, %s descriptors of %s\n' \
  "$rounds" "$kills" "$resumes" "$pairs" "$results" "$visits" "$grown" "$files" "$server_files"
printf '%s failures\n' "${#failures[@]}"
printf '  %s\n' ${failures[@]+"${failures[@]}"}
[ ${#failures[@]} -eq 0 ]
