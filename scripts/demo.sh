#!/usr/bin/env bash
# From a bare Debian 12 or 13 to a colour volume: installs what is missing, builds, makes the sample capture and runs it.
#   bash scripts/demo.sh [FOLDER]    results go to FOLDER/capture and FOLDER/run, else to those of out/demo
set -euo pipefail
cd "$(dirname "$0")/.."
out="${1:-out/demo}"

bash scripts/install_dependencies.sh
cmake --preset release -DCNERF_TESTS=OFF -DCNERF_VIEWER=ON > /dev/null
cmake --build --preset release --target cnerf
cmake --build --preset release --target cnerf_viewer_page || echo "demo: the viewer's page could not be built; the rest goes on"
cnerf=build/release/cnerf

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
