#!/usr/bin/env bash
# recipes_test.sh: what containers and the release workflow call is there, and what they copy is what packages are called.
set -euo pipefail
cd "$(dirname "$0")/../.."
recipes=(containers/Dockerfile containers/cnerf.def .github/workflows/release.yml)
called=0
while read -r script; do
  [ -f "$script" ] || { echo "$script is called by a recipe, and is not there" >&2; exit 1; }
  bash -n "$script"
  called=$((called + 1))
done < <(grep -ohE 'scripts/[a-z_]+\.sh' "${recipes[@]}" | sort -u)
[ "$called" -gt 0 ] || { echo "the recipes call no script" >&2; exit 1; }
while read -r package; do
  grep -qE "PACKAGE_NAME $package\)" cmake/packages.cmake ||
    { echo "the recipes install $package, which cmake/packages.cmake does not make" >&2; exit 1; }
done < <(grep -ohE 'packages/[a-z0-9-]+_\*\.deb' "${recipes[@]}" | sed 's|packages/||; s|_\*.*||' | sort -u)
echo "$called scripts, all there"
