# Five captures in pictures of some 200 to 400 pixels, trained with the preset quick, and how well takes colour them:
# for scripts that source this after they set `out`. Captures are looked for in $CNERF_DATA (else ../shared/data), the
# program is $CNERF (else the release build).
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
scenes=${CNERF_DATA:-$root/../shared/data}/scenes
cnerf=${CNERF:-$root/build/release/cnerf}
mkdir -p "$out"

# Folder and options of a capture. The sample's own split holds out views of one side alone.
declare -A folder=([sample]=$out/sample-capture [lego]=$scenes/lego [fox]=$scenes/fox [flower]=$scenes/flower [fruit]=$scenes/fruit)
declare -A options=([sample]='--holdout 5' [lego]='--downscale 2' [fox]='--downscale 4 --holdout 8'
  [flower]='--downscale 8 --holdout 8' [fruit]='--downscale 2 --holdout 8')

train_small() {  # train_small CAPTURE, to $out/CAPTURE unless it is there
  if [ "$1" = sample ] && [ ! -e "${folder[sample]}" ]; then "$cnerf" sample -o "${folder[sample]}" --progress quiet; fi
  if grep -qs '"finished": true' "$out/$1/run.json"; then return; fi
  # shellcheck disable=SC2086  # options are words
  "$cnerf" train "${folder[$1]}" -o "$out/$1" --preset quick ${options[$1]} --overwrite --progress quiet
}

read -ra seeds <<< "${SEEDS:-1 2 3}"
read -ra settings <<< "${SET:-}"

colour_small() {  # colour_small CAPTURE TAKE COLORIZER: takes TAKE-SEED with their numbers, unless they are there
  local seed take
  for seed in "${seeds[@]}"; do
    take=$2-$seed
    if [ -e "$out/$1/takes/$take/metrics.json" ]; then continue; fi
    "$cnerf" colorize "$out/$1" --colorizer "$3" --take "$take" --overwrite --progress quiet --set stage2.seed="$seed" \
      "${settings[@]}"
    "$cnerf" eval "$out/$1" --take "$take" --progress quiet
  done
}

print_colours() {  # print_colours TAKE CAPTURE...: a table of what colour_small made
  python3 - "$out" "$1" "${seeds[*]}" "${@:2}" << 'PYTHON'
import json, statistics, sys
from pathlib import Path
out, take, seeds, names = Path(sys.argv[1]), sys.argv[2], sys.argv[3].split(), sys.argv[4:]
print("| capture | ab error, share of grey's, per seed | median | colourfulness, share of the truth's, median |\n|---|---|---|---|")
medians = []
for name in names:
    means = [json.loads((out / name / "takes" / f"{take}-{seed}" / "metrics.json").read_text())["mean"] for seed in seeds]
    shares = [mean["ab_error"] / mean["ab_error_grey"] for mean in means]
    vivid = statistics.median(mean["colourfulness"] / mean["colourfulness_truth"] for mean in means)
    medians.append(statistics.median(shares))
    print(f"| {name} | {', '.join(f'{share:.0%}' for share in shares)} | {medians[-1]:.1%} | {vivid:.2f} |")
print(f"| mean | | {sum(medians) / len(medians):.1%} | |")
PYTHON
}
