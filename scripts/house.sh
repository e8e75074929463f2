#!/usr/bin/env bash
# The house's measures: what a review of the structure found and no compiler checks. Prints a row each, with its limit, and
# fails where one is beyond it. CTest runs it as house.measures. A limit goes down, or up with the feature
# that it is for.
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
    if [ -n "$(sed -E 's|//.*||' "$file" | grep -E "$pattern")" ]; then echo "$file"; fi
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
row "copies of formulas between processor and CUDA" $copies 0

row "options" "$(grep -cE '^\| `[a-z0-9_]+(\.[a-z0-9_]+)*` \|' docs/configuration.md)" 110
row "seeds in ASCII hex" "$(code '0x[67][0-9a-f]([2-7][0-9a-f])+u?ll\b' "${product[@]}")" 0
row "process-global device" "$(code 'std::atomic<Device>' "${product[@]}")" 0
row "is_photometric in src/train" "$(code '\bis_photometric\b' src/train)" 0
row "core linking the comparison" "$(find src bake export viewer -name CMakeLists.txt ! -path 'src/app/*' ! -path 'src/compare/*' ! -path '*/node_modules/*' |
  xargs grep -l cnerf_compare | wc -l)" 0
row "definitions of median" "$(code '\bmedian\((std::(vector|span)<[^()]*>|const [^()]*) [a-z]+\) \{' "${product[@]}")" 1
row "definitions of is_forward_facing" "$(code 'bool is_forward_facing\(.*\{' "${product[@]}")" 0
row "files that encode pictures" "$(files_with '\bim(encode|write)\(' "${product[@]}" | wc -l)" 1
row "files that read JSON records field by field" \
  "$(sources "${product[@]}" | xargs grep -cE '\.at\("[a-z_0-9]+"\)\.get|\.value\("[a-z_0-9]+",' | awk -F: '$2 > 3 { n++ } END { print n + 0 }')" 1
row "records of decisions" "$(find docs/decisions -name '*.md' ! -name README.md | wc -l)" 12
sizes=$(sources "${product[@]}" | grep -vE 'kernels\.inl$' | xargs perl scripts/functions.pl)
row "functions of more than 60 lines, kernels excepted" "$(awk '$1 > 60' <<< "$sizes" | wc -l)" 0
row "functions of more than 6 parameters, kernels excepted" "$(awk '$2 > 6' <<< "$sizes" | wc -l)" 0
awk '$1 > 60 || $2 > 6 { print "  " $3, $4 ": " $1 " lines, " $2 " parameters" }' <<< "$sizes"
row "product lines" "$(find src encoding bake export viewer -type f -regex '.*\.\(h\|cpp\|inl\|cu\|cuh\|py\|ts\|css\|html\|js\)' \
  ! -path '*/node_modules/*' ! -path '*/dist/*' ! -path 'viewer/tests/*' -print0 | xargs -0 cat | wc -l)" 80974  # a ratchet: who adds lines raises it in the same commit
exit $((failures > 0))
