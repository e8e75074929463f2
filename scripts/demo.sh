#!/usr/bin/env bash
# From a bare Debian 12 or 13 to a colour volume: installs what is missing, builds, makes the sample capture and runs it.
#   bash scripts/demo.sh [FOLDER]    results go to FOLDER/capture and FOLDER/run, else to those of out/demo; those of an
#                                    earlier demo are replaced
set -euo pipefail
out=${1:+$(realpath -m -- "$1")}
cd "$(dirname "$0")/.."
mark=.cnerf-demo  # in folders whose capture and run are a demo's
if [ -n "$out" ] && [ ! -e "$out/$mark" ]; then
  for made in "$out/capture" "$out/run"; do
    if [ -e "$made" ]; then
      echo "demo: $made is there and not a demo's; name another FOLDER" >&2
      exit 73
    fi
  done
fi
out=${out:-out/demo}

bash scripts/install_dependencies.sh
cmake --preset release -DCNERF_TESTS=OFF -DCNERF_VIEWER=ON > /dev/null
cmake --build --preset release --target cnerf
cmake --build --preset release --target cnerf_viewer_page || echo "demo: the viewer's page could not be built; the rest goes on"
cnerf=build/release/cnerf

mkdir -p "$out"
touch "$out/$mark"
rm -rf "$out/capture" "$out/run"
"$cnerf" sample -o "$out/capture"
"$cnerf" run "$out/capture" -o "$out/run" --preset quick

echo
echo "volume (OpenVDB):    $(ls "$out"/run/bakes/*/*.vdb)"
echo "before and after:    $out/run/contact_sheet.png"
echo "turntable video:     $(ls "$out"/run/renders/*/turntable.mp4)"
echo "metrics:             $out/run/metrics.json"
if [ -f build/release/share/cnerf/viewer/index.html ]; then
  echo "in a browser:        $cnerf view $out/run"
else
  echo "in a browser:        not yet: the viewer's page could not be built; it wants npm and what 'npm ci --prefix viewer' gets"
fi
