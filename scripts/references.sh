#!/usr/bin/env bash
# What photographs of other places with the same things are worth as `reference:`, with the preset quick: held-out ab
# error as a share of grey's, of three seeds of stage 2 on one stage 1. `fruit` learns from three apples and two bananas
# of GroceryStoreDataset, `flower` from five other flowers of Caltech-101, all 128 pixels high or wide.
#   bash scripts/references.sh OUT [fruit|flower]...
# Photographs are those of $CNERF_DATA/colorizer (else ../shared/data), the program is $CNERF (else the release build):
# another OUT and another program compare two. SEEDS="1 2 3", SET="--set ..." for other settings of stage 2. What is
# finished stays, so that the same command goes on after a stop. Needs Python 3. Prints a table.
set -euo pipefail

out=$1
shift
if [ $# -eq 0 ]; then set -- fruit flower; fi
source "$(dirname "$0")/small_captures.sh"

declare -A photographs=(
  [fruit]="grocery/Royal-Gala/00000 grocery/Royal-Gala/00139 grocery/Royal-Gala/00141 grocery/Banana/00057 grocery/Banana/00074"
  [flower]="caltech101/lotus/00003 caltech101/lotus/00101 caltech101/sunflower/00038 caltech101/sunflower/00253
    caltech101/water_lilly/00011")

reference() {  # reference CAPTURE: the colorizer's name; photographs are unpacked where they are not there yet
  local files=() photograph archive
  for photograph in ${photographs[$1]}; do
    for archive in "$(dirname "$scenes")"/colorizer/photos-128px-*.tar; do
      if [ -e "$out/photographs/$photograph.webp" ]; then break; fi
      mkdir -p "$out/photographs"
      tar -xf "$archive" -C "$out/photographs" "$photograph.webp" 2> /dev/null || true
    done
    files+=("$out/photographs/$photograph.webp")
  done
  (IFS=, && echo "reference:${files[*]}")
}

for name in "$@"; do
  train_small "$name"
  colour_small "$name" elsewhere "$(reference "$name")"
done > "$out/references-log.txt"
print_colours elsewhere "$@"
