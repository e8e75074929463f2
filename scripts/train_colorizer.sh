#!/usr/bin/env bash
# Trains the built-in colorizer and writes its weights and score table. The run behind the shipped weights took 20
# minutes on one H200; see docs/colorizer-model-card.md.
#
#   [HELD_OUT=SET] [STEPS=59498] scripts/train_colorizer.sh DATA OUTPUT [options of cnerf-train-colorizer]
#
# DATA holds colorizer/ (archives of images, unpacked to OUTPUT/images) and lpips/ (SqueezeNet weights for the auxiliary
# feature loss). With HELD_OUT, a set such as bsds500 has no part in training, and the network is judged on it. The
# trainer is a target of the project's build: BUILD names the folder, build/release if it is not set.
set -euo pipefail

if [ $# -lt 2 ]; then
  sed -n '2,9p' "$0" >&2
  exit 64
fi
root=$(cd "$(dirname "$0")/.." && pwd)
data=$1
output=$2
shift 2

build=${BUILD:-$root/build/release}
if [ ! -f "$build/CMakeCache.txt" ]; then cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release; fi
ninja -C "$build" cnerf-train-colorizer cnerf_images

images=$output/images
for archive in "$data"/colorizer/*.tar; do
  folder=$images/$(basename "$archive" .tar)
  [ -d "$folder" ] && continue
  mkdir -p "$folder.part"
  tar -xf "$archive" -C "$folder.part"
  mv "$folder.part" "$folder"
done

# A set that is held out has no part in training; the network is judged on it beside Kodak.
photos=$images
evaluation=("$images"/eval-kodak-384px)
if [ -n "${HELD_OUT:-}" ]; then
  if [ ! -d "$images/photos-128px-0/$HELD_OUT" ]; then
    echo "HELD_OUT=$HELD_OUT: no such set; there are: $(ls "$images/photos-128px-0" | paste -sd ' ')" >&2
    exit 64
  fi
  photos=$images/without-$HELD_OUT
  unseen=$images/unseen-$HELD_OUT
  rm -rf "$photos" "$unseen"
  mkdir "$photos" "$unseen"
  for folder in photos-128px-0 photos-128px-1; do
    cp -rl "$images/$folder" "$photos"
    find "$photos/$folder/$HELD_OUT" -type f -exec mv -t "$unseen" {} +
    rm -r "${photos:?}/$folder/$HELD_OUT"
  done
  evaluation+=("$unseen")
fi

exec "$(find "$build" -name cnerf-train-colorizer -type f -executable | head -1)" \
  --photos "$photos"/photos-128px-{0,1} \
  --mosaics "$images"/objects-64px-{0,1} \
  --mosaic-labels "$data"/colorizer/objects-64px-labels.npy \
  --evaluation "${evaluation[@]}" \
  --teacher "$data"/lpips/lpips_sq_f32.bin \
  --steps "${STEPS:-59498}" --epoch-steps 10000 --output "$output" "$@"
