#!/usr/bin/env bash
# Is the view that `cnerf colorize --suggest-keyframes 1` names better to paint than the middle training view? Five
# captures, the preset quick, pictures of some 200 to 400 pixels: held-out ab error with the one key frame and the other.
#   bash scripts/key_views.sh OUT [CAPTURE...]
# Captures are looked for in $CNERF_DATA (else ../shared/data), the program is $CNERF (else the release build). What is
# finished stays, so that the same command goes on after a stop. Needs Python 3. Prints a table.
set -euo pipefail

out=$1
shift
if [ $# -eq 0 ]; then set -- sample lego fox flower fruit; fi
source "$(dirname "$0")/small_captures.sh"

# The photograph of a view, in colour.
photograph() {  # photograph CAPTURE VIEW
  case $1 in
    sample) echo "${folder[sample]}/color/$(basename "$2")" ;;
    lego) echo "${folder[lego]}/${2%.png}.png" ;;
    flower) echo "${folder[flower]}/images_8/$(basename "$2")" ;;
    *) echo "${folder[$1]}/images/$(basename "$2")" ;;
  esac
}
# A take with one key frame, and its numbers.
judge() {  # judge CAPTURE TAKE VIEW
  local run=$out/$1
  if [ -e "$run/takes/$2/metrics.json" ]; then return; fi
  "$cnerf" colorize "$run" --keyframe "$3=$(photograph "$1" "$3")" --take "$2" --overwrite --progress quiet
  "$cnerf" eval "$run" --take "$2" --progress quiet
}

for name in "$@"; do
  train_small "$name"
  # Of the uncoloured scene: no take's doubts.
  "$cnerf" colorize "$out/$name" --suggest-keyframes 1 --take grey --progress quiet
  read -r middle suggested < <(python3 -c '
import json, sys
views = json.load(open(sys.argv[1]))
print(views["alone"][len(views["alone"]) // 2]["view"], views["suggested"][0]["view"])' "$out/$name/key_views.json")
  judge "$name" middle "$middle"
  judge "$name" suggested "$suggested"
done > "$out/log.txt"

python3 - "$out" "$@" << 'PYTHON'
import json, sys
from pathlib import Path
print("| capture | middle view | ab error | suggested view | ab error | change |\n|---|---|---|---|---|---|")
changes, errors = [], []
for name in sys.argv[2:]:
    run = Path(sys.argv[1]) / name
    views = json.loads((run / "key_views.json").read_text())
    names = [views["alone"][len(views["alone"]) // 2]["view"], views["suggested"][0]["view"]]
    means = [json.loads((run / "takes" / take / "metrics.json").read_text())["mean"] for take in ("middle", "suggested")]
    errors.append([mean["ab_error"] for mean in means])
    changes.append(errors[-1][1] / errors[-1][0] - 1)
    cells = [f"`{Path(view).stem}` | {mean['ab_error']:.2f}, {mean['ab_error'] / mean['ab_error_grey']:.0%} of grey's"
             for view, mean in zip(names, means)]
    print(f"| {name} | {cells[0]} | {cells[1]} | {changes[-1]:+.0%} |")
middle, suggested = (sum(column) / len(errors) for column in zip(*errors))
print(f"| mean error | | {middle:.2f} | | {suggested:.2f} | {suggested / middle - 1:+.0%} |")
print(f"| mean change | | | | | {sum(changes) / len(changes):+.0%} |")
PYTHON
