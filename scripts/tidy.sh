#!/usr/bin/env bash
# clang-tidy with the checks of .clang-tidy, every warning an error.
#   scripts/tidy.sh                 all of them, some hours of a core
#   scripts/tidy.sh FILE...         these
#   scripts/tidy.sh --changed       those changed since origin/main, or since the last commit where HEAD is origin/main
# LIMIT=seconds ends it early; the files that were not reached are named and do not count as failures.
set -euo pipefail
cd "$(dirname "$0")/.."
database=build/tidy/compile_commands.json
command -v clang-tidy > /dev/null || { echo "tidy: not checked, for want of clang-tidy"; exit 0; }
cuda=OFF
if command -v nvcc > /dev/null; then cuda=ON; fi
cmake --log-level=WARNING --preset tidy -DCNERF_CUDA=$cuda > /dev/null

compiled() { sed -n "s|^ *\"file\": \"$PWD/\(.*\.cpp\)\".*|\1|p" "$database" | sort -u; }
# Sources that changed, and those beside a header that changed.
changed() {
  local base
  base=$(git merge-base HEAD origin/main 2> /dev/null || true)
  if [ -z "$base" ] || [ "$base" = "$(git rev-parse HEAD)" ]; then base=$(git rev-parse HEAD~1 2> /dev/null || git rev-parse HEAD); fi
  git diff --name-only "$base" -- '*.cpp' '*.h' | sed 's/\.h$/.cpp/' | sort -u
}
case ${1:-} in
  --changed) files=$(comm -12 <(compiled) <(changed)) ;;
  '') files=$(compiled) ;;
  *) files=$(printf '%s\n' "$@") ;;
esac
[ -n "$files" ] || { echo "tidy: nothing to check"; exit 0; }

results=$(mktemp -d)
trap 'rm -rf "$results"' EXIT
export results
# clang cannot read the compiler's precompiled headers, and does not need them.
sed -E -e 's| -Winvalid-pch -include [^ ]*cmake_pch\.hxx||' \
  -e "s|^( *\"command\": \"[^ ]*)(.*/torch/csrc/)|\1 -include $PWD/cmake/torch_for_clang.h\2|" \
  "$database" > "$results/compile_commands.json"
deadline=$((SECONDS + ${LIMIT:-86400}))
# One file; its result is a file "ok" or "bad" of its name.
check() {
  local log=$results/${1//\//_}
  if clang-tidy -p "$results" --quiet --warnings-as-errors='*' --extra-arg=-Wno-unknown-warning-option "$1" > "$log" 2> "$log.err"; then
    echo "$1" >> "$results/ok"
  else
    echo "$1" >> "$results/bad"
    cat "$log"
    grep -E 'error:' "$log.err" || true
  fi
}
export -f check
status=0
timeout "$((deadline - SECONDS))" xargs -P "$(nproc)" -n 1 bash -c 'check "$0"' <<< "$files" || status=$?
touch "$results/ok" "$results/bad"
left=$(comm -23 <(sort <<< "$files") <(sort "$results/ok" "$results/bad"))
echo "tidy: $(wc -l < "$results/ok") files clean, $(wc -l < "$results/bad") not, $(grep -c . <<< "$left" || true) not reached"
if [ -n "$left" ]; then
  sed 's/^/tidy: not reached: /' <<< "$left"
  [ $status -eq 124 ] || exit 1
fi
[ ! -s "$results/bad" ]
