#!/usr/bin/env bash
# Takes cnerf's package or archive to a Debian that has nothing of it, uses it, removes it and looks for what is left.
# scripts/try_debian.sh runs it in a bare root; it needs root, and changes the system it runs on.
#   bash scripts/try_package.sh CNERF.deb|CNERF.tar.gz
set -euo pipefail
package=$(realpath "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export DEBIAN_FRONTEND=noninteractive

# Everything but what apt and dpkg keep of their own work, and what they make anew.
list_files() {
  find / -xdev \( -path /proc -o -path /sys -o -path /dev -o -path /tmp -o -path /var/tmp -o -path /var/cache -o -path /var/log \
    -o -path /var/lib/apt -o -path /var/lib/dpkg -o -path "$PWD" -o -path "$work" \) -prune -o -print | sort
}
packages() { dpkg-query -W -f '${Package} ${db:Status-Abbrev}\n' | sort; }

# From the sample to its volume.  use PROGRAM
use() {
  "$1" doctor
  "$1" sample -o "$work/capture" --progress plain
  "$1" run "$work/capture" -o "$work/run" --preset quick --progress plain
  ls -l "$work"/run/bakes/*/volume.vdb
}

try_archive() {
  tar -xzf "$1" -C "$work"
  use "$work"/cnerf-*/bin/cnerf
}

try_package() {
  apt-get update -qq
  list_files > "$work/files_before"
  packages > "$work/packages_before"
  local begin=$SECONDS
  apt-get install -y -qq "$1" > "$work/install.log" 2>&1 || { tail -n 20 "$work/install.log" >&2; exit 1; }
  local took=$((SECONDS - begin))
  use cnerf
  echo "$(($(packages | wc -l) - $(wc -l < "$work/packages_before"))) packages in $took s; to the end of the run $((SECONDS - begin)) s"

  apt-get purge -y -qq --autoremove cnerf > "$work/purge.log" 2>&1 || { tail -n 20 "$work/purge.log" >&2; exit 1; }
  list_files > "$work/files_after"
  packages > "$work/packages_after"
  diff "$work/packages_before" "$work/packages_after" && echo "purged: the same packages as before"
  comm -13 "$work/files_before" "$work/files_after" > "$work/left"
  echo "files that were not there before: $(wc -l < "$work/left")"
  [ ! -s "$work/left" ] || { head -n 20 "$work/left" >&2; exit 1; }
}

case $package in
  *.deb) try_package "$package" ;;
  *) try_archive "$package" ;;
esac
