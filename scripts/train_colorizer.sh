#!/usr/bin/env bash
# Trains the built-in colorizer and writes its weights and score table. The run behind the shipped weights took 20
# minutes on one H200; see docs/colorizer-model-card.md.
#
#   scripts/train_colorizer.sh DATA OUTPUT [options of cnerf-train-colorizer]
#
# DATA holds colorizer/ (image archives) and lpips/ (SqueezeNet weights for the auxiliary feature loss). The trainer is
# built from src/colorizer_training as a project of its own, with the LibTorch of TORCH_PREFIX (a CMake prefix path;
# python3's torch when empty). It needs OpenSSL, zlib, libjpeg, libwebp and CLI11 beside it.
set -euo pipefail

if [ $# -lt 2 ]; then
  sed -n '2,9p' "$0" >&2
  exit 64
fi
root=$(cd "$(dirname "$0")/.." && pwd)
data=$1
output=$2
shift 2

prefix=${TORCH_PREFIX:-$(python3 -c 'import torch; print(torch.utils.cmake_prefix_path)' 2>/dev/null || true)}
build=${BUILD:-$root/build/colorizer-training}
cmake -S "$root/src/colorizer_training" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release \
  ${prefix:+-DCMAKE_PREFIX_PATH="$prefix"}
ninja -C "$build"

exec "$build/cnerf-train-colorizer" \
  --photos "$data"/colorizer/photos-128px-{0,1}.tar \
  --mosaics "$data"/colorizer/objects-64px-{0,1}.tar \
  --mosaic-labels "$data"/colorizer/objects-64px-labels.npy \
  --evaluation "$data"/colorizer/eval-kodak-384px.tar \
  --teacher "$data"/lpips/lpips_sq_f32.bin \
  --steps 59498 --epoch-steps 10000 --output "$output" "$@"
