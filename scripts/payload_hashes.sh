#!/usr/bin/env bash
# Prints the SHA-256 of what training computes, so that two builds can be compared: the pieces of both stages' snapshots,
# without the JSON header, which names program and options. Processor, 2 threads, fixed seeds; two minutes on two cores.
#   scripts/payload_hashes.sh [CNERF]      CNERF: the program; build/release/cnerf if not given
set -euo pipefail
cnerf=$(realpath "${1:-$(dirname "$0")/../build/release/cnerf}")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

# A snapshot is "CNERFSNP", u32 version, u64 header size, header, pieces, 64 hex digits of SHA-256.
payload_hash() {
  local header size
  header=$(od -A n -t u8 --endian=little -j 12 -N 8 "$1" | tr -d ' ')
  size=$(stat -c %s "$1")
  tail -c +$((20 + header + 1)) "$1" | head -c $((size - 20 - header - 64)) | sha256sum | cut -d ' ' -f 1
}

run() { CUDA_VISIBLE_DEVICES='' "$cnerf" "$@" --device cpu --threads 2 --progress quiet > log 2>&1 || { cat log >&2; exit 1; }; }

"$cnerf" sample -o capture > log 2>&1 || { cat log >&2; exit 1; }
run train capture -o run --set stage1.seed=5 --set stage1.steps=500
echo "stage 1    $(payload_hash run/stage1.snapshot)"
run colorize run --take reference --colorizer "reference:capture/references/$(ls capture/references | head -1)" \
  --set stage2.seed=5 --set stage2.patches=40 --set stage2.distill_steps=100 --set colorizer.reference_steps=60
echo "reference  $(payload_hash run/takes/reference/take.snapshot)"
