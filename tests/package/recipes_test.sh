#!/usr/bin/env bash
# recipes_test.sh CNERF: what containers and the release workflow call is there, what they copy is what packages are called, and
# the names of the release are those that hashes were made for.
set -euo pipefail
program=$(realpath "$1")
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

# scripts/package.sh refuses programs that name the folder that they were built in.
folders=0
while read -r folder; do
  case $PWD/ in "$folder"/*) folders=$((folders + 1)); continue ;; esac  # a program holds the name of its own tree
  if strings "$program" | grep -F "$folder/" > /dev/null; then
    echo "a recipe builds in $folder, and the program has text that begins so" >&2
    exit 1
  fi
  folders=$((folders + 1))
done < <(sed -nE 's/^WORKDIR (\/.*)/\1/p; s/^ *cd (\/[^ ]*) .*/\1/p' "${recipes[@]}" | grep -vx /work)
[ "$folders" -eq 2 ] || { echo "$folders recipes build in a folder of their own, not 2" >&2; exit 1; }

# The step that collects the release, on files that are named like packages.
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
mkdir -p "$scratch/artifacts/debian-12"
touch "$scratch/artifacts/debian-12"/{cnerf_1.0.0-1~deb12_amd64.deb,cnerf.spdx.json,SHA256SUMS}
sed -n '/^          mkdir release$/,/SHA256SUMS$/p' .github/workflows/release.yml > "$scratch/collect.sh"
(cd "$scratch" && bash -eu collect.sh)
found=$(cd "$scratch/release" && echo *)
[ "$found" = "SHA256SUMS cnerf-debian-12.spdx.json cnerf_1.0.0-1.deb12_amd64.deb" ] ||
  { echo "the release has other files: $found" >&2; exit 1; }
(cd "$scratch/release" && sha256sum --quiet -c SHA256SUMS)
echo "$called scripts, all there"
