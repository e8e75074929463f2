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
take=${TAKE:-builtin}

for name in "$@"; do
  train_small "$name"
  colour_small "$name" "$take" builtin
done > "$out/builtin-log.txt"
print_colours "$take" "$@"
