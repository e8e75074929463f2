#!/usr/bin/env bash
# What the built-in network's colours are worth on five captures with the preset quick: held-out ab error as a share of
# grey's, and colourfulness as a share of the truth's, of three seeds of stage 2 on one stage 1.
#   bash scripts/builtin.sh OUT [CAPTURE...]
# OUT may be that of scripts/key_views.sh, whose trained runs are taken then. SEEDS="1 2 3", SET="--set ..." for other
# settings of stage 2, and TAKE for what their takes begin with. What is finished stays, so that the same command goes on
# after a stop. Needs Python 3. Prints a table.
set -euo pipefail

out=$1
shift
if [ $# -eq 0 ]; then set -- sample lego fox flower fruit; fi
source "$(dirname "$0")/small_captures.sh"
read -ra seeds <<< "${SEEDS:-1 2 3}"
read -ra settings <<< "${SET:-}"

for name in "$@"; do
  train_small "$name"
  for seed in "${seeds[@]}"; do
    take=${TAKE:-builtin}-$seed
    if [ -e "$out/$name/takes/$take/metrics.json" ]; then continue; fi
    "$cnerf" colorize "$out/$name" --colorizer builtin --take "$take" --overwrite --progress quiet --set stage2.seed="$seed" \
      "${settings[@]}"
    "$cnerf" eval "$out/$name" --take "$take" --progress quiet
  done
done > "$out/builtin-log.txt"

python3 - "$out" "${TAKE:-builtin}" "${seeds[*]}" "$@" << 'PYTHON'
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
