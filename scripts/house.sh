#!/usr/bin/env bash
# The house's measures: what a review of the structure found and no compiler checks. Prints a row each, with its limit, and
# fails where one is beyond it. CTest runs it as house.measures.
#   scripts/house.sh [--functions]     --functions: also sizes of functions by clang-tidy, some minutes
set -euo pipefail
cd "$(dirname "$0")/.."
product=(src encoding bake export viewer/server)
engine=(src/color src/render src/field src/engine encoding/cpu encoding/cuda encoding/hash_grid_math.h)
if [ -d src/optim ]; then engine+=(src/optim); fi
failures=0

row() {  # row NAME VALUE LIMIT
  local mark=
  if [ "$2" -gt "$3" ]; then
    mark='  <-- beyond its limit'
    failures=$((failures + 1))
  fi
  printf '%-72s %6s of %s%s\n' "$1" "$2" "$3" "$mark"
}
sources() { find "$@" -regex '.*\.\(h\|cpp\|inl\|cu\|cuh\)' ! -path '*/node_modules/*' | sort; }
# Lines of code, without comments, that match.  code REGEX PATH...
code() {
  local pattern=$1
  shift
  sources "$@" | xargs sed -E 's|//.*||' | grep -cE "$pattern" || true
}
# Files whose code, without comments, matches.
files_with() {
  local pattern=$1 file
  shift
  for file in $(sources "$@" | xargs grep -lE "$pattern" || true); do
    if sed -E 's|//.*||' "$file" | grep -qE "$pattern"; then echo "$file"; fi
  done
}

# A formula's tell-tale stands in one file; each further one is a copy.
copies=0
formula() {  # formula NAME REGEX
  local found
  found=$(files_with "$2" "${engine[@]}" | grep -v colorspace_math.h || true)
  local extra=$(($(grep -c . <<< "$found" || true) - 1))
  if [ "$extra" -gt 0 ]; then
    copies=$((copies + 1))
    echo "  copied: $1: $(tr '\n' ' ' <<< "$found")"
  elif [ "$extra" -lt 0 ]; then
    copies=$((copies + 1))
    echo "  not found, mend scripts/house.sh: $1"
  fi
}
formula "stage-1 loss and its gradient" '\blightness_derivative\('
formula "constants of training" 'k(TrainingTransmittance|OccupancyWarmUp) ='
formula "schedule of the occupancy grid" 'kOccupancyWarmUp \? 4 : 16'
formula "adaptive number of rays" 'fill < 0\.5|clamp\(fill, 0\.5'
formula "threshold of the occupancy grid" '\b1e4f\b'
formula "start of a march" 'jitter \* (march_)?step\('
formula "drawing a training ray" 'luminance_from_lightness\(100'
formula "KL's gradient by a label" '\-=? *scale \* (z|label)|label\.weight\[i\] \* scale'
formula "annealed mean" '/ temperature\b'
formula "Adam" 'sqrtf?\(second'
formula "initial table" 'kInitialReach ='
row "copies of formulas between processor and CUDA" $copies 11

row "options" "$(grep -cE '^\| `[a-z0-9_]+(\.[a-z0-9_]+)*` \|' docs/configuration.md)" 173
row "seeds in ASCII hex" "$(code '\b0x(6|7)[0-9a-f]([2-7][0-9a-f])+(u|ull)?\b' "${product[@]}")" 0
row "process-global device" "$(code '\b(set_device|selected_device|default_device)\(|std::atomic<Device>' "${product[@]}")" 0
row "is_photometric in src/train" "$(code '\bis_photometric\b' src/train)" 99
row "core linking the comparison" "$(grep -rlE 'cnerf_compare' --include=CMakeLists.txt src/{base,color,picture,capture,field,render,engine,colorizer,train,evaluate,config} bake export viewer | wc -l)" 0
row "definitions of median" "$(code '^(inline |static |template.*)?[A-Za-z:<>]+ median\(.*\{' "${product[@]}")" 4
row "definitions of is_forward_facing" "$(code '^(inline |static )?bool is_forward_facing\(.*\{' "${product[@]}")" 2
row "PNG encoders" "$(files_with 'imencode\("\.png"|imwrite\(|encode\(.*"\.png"' "${product[@]}" | wc -l)" 6
row "hand serialisers (functions to_json, from_json, read_/write_ with .at() by field)" \
  "$(sources "${product[@]}" | xargs grep -cE '\.at\("[a-z_]+"\)\.get|value\("[a-z_]+",' | awk -F: '$2 > 3 { n++ } END { print n + 0 }')" 99
row "product lines" "$(sources src encoding bake export viewer | xargs cat | wc -l)" 99999

if [ "${1:-}" = --functions ] && command -v clang-tidy > /dev/null && [ -f build/release/compile_commands.json ]; then
  found=$(sed -n "s|^ *\"file\": \"$PWD/\(.*\.cpp\)\".*|\1|p" build/release/compile_commands.json | grep -vE '^tests/' | sort -u |
    xargs -P "$(nproc)" -n 4 clang-tidy -p build/release --quiet --checks='-*,readability-function-size' --extra-arg=-w \
      --config='{CheckOptions: [{key: readability-function-size.LineThreshold, value: "60"}, {key: readability-function-size.ParameterThreshold, value: "6"}, {key: readability-function-size.StatementThreshold, value: "4000"}, {key: readability-function-size.BranchThreshold, value: "4000"}]}' 2> /dev/null |
    grep -E 'exceeds recommended size' | sort -u || true)
  row "functions of more than 60 lines or 6 parameters" "$(grep -c . <<< "$found" || true)" 99
  echo "$found"
else
  # Without a compiler: by the lines of formatted code, from one that ends in "{" without indentation to its "}".
  row "functions of more than 60 lines, kernels excepted" "$(sources "${product[@]}" | grep -vE '\.cuh?$' | xargs awk '
    FNR == 1 { begin = 0 }
    /^[^ \t#\/}].*\) (const )?(noexcept )?\{$/ || (/^[^ \t#\/}].*\($/ ) || /^    .*\) (const )?\{$/ { if (!begin) begin = FNR }
    /^}/ { if (begin && FNR - begin > 60) print FILENAME ":" begin; begin = 0 }' | wc -l)" 99
fi
exit $((failures > 0))
