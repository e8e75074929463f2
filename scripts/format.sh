#!/usr/bin/env bash
# Checks C++ and CUDA sources against .clang-format with clang-format 14; other versions format otherwise.
#   scripts/format.sh          fails and names the files that are off
#   scripts/format.sh --fix    formats them
set -euo pipefail
cd "$(dirname "$0")/.."

format=$(command -v clang-format-14 || command -v clang-format || true)
if [ -z "$format" ] || ! "$format" --version | grep "version 14\." > /dev/null; then
  echo "format: not checked, for want of clang-format 14"
  exit 0
fi
# What git tracks or would, or in an unpacked archive what lies there.
sources() {
  git ls-files -z --cached --others --exclude-standard -- '*.h' '*.cpp' '*.inl' '*.cu' '*.cuh' 2> /dev/null ||
    find src encoding bake export viewer/server tests -regex '.*\.\(h\|cpp\|inl\|cu\|cuh\)' -print0
}
if [ "${1:-}" = --fix ]; then
  sources | xargs -0 -n 40 -P "$(nproc)" "$format" -i
  exit 0
fi
off=$(sources | xargs -0 -n 40 -P "$(nproc)" "$format" --dry-run 2>&1 | sed -n 's/^\([^:]*\):[0-9]*:.*clang-format-violations.*/\1/p' | sort -u)
if [ -n "$off" ]; then
  echo "$off"
  echo "format: $(wc -l <<< "$off") files are off; scripts/format.sh --fix formats them"
  exit 1
fi
echo "format: clean"
