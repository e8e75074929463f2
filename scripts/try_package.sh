#!/usr/bin/env bash
# Takes cnerf's package or archive to a Debian that has nothing of it, uses it, removes it and looks for what is left.
# scripts/try_debian.sh runs it in a bare root; it needs root, and changes the system it runs on.
#   bash scripts/try_package.sh CNERF.deb|CNERF.tar.gz
#   bash scripts/try_package.sh CNERF.deb EARLIER.deb      upgrades from the earlier one, whose run has to open
set -euo pipefail
package=$(realpath "$1")
earlier=${2:+$(realpath "$2")}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export DEBIAN_FRONTEND=noninteractive
TIMEFORMAT='%lR by the clock, %lU of processor time and %lS in the system'

# Everything but what apt and dpkg keep of their own work, what is made anew, and what systemd and adduser leave behind,
# which libraries bring along.
list_files() {
  local others='/etc/((passwd|group|shadow|gshadow)-|machine-id|mtab)|/root/\.ssh'
  others+='|/var/lib/(private|systemd(/(coredump|pstore))?)'
  find / -xdev \( -path /proc -o -path /sys -o -path /dev -o -path /run -o -path /tmp -o -path /var/tmp -o -path /var/cache \
    -o -path /var/log -o -path /var/lib/apt -o -path /var/lib/dpkg -o -path "$PWD" -o -path "$work" \) -prune -o -print |
    grep -vxE "$others" | sort
}
packages() { dpkg-query -W -f '${Package} ${db:Status-Abbrev}\n' | sort; }

# Calls apt-get, which is quiet unless it fails.
quietly() { apt-get -y -qq "$@" > "$work/apt.log" 2>&1 || { tail -n 20 "$work/apt.log" >&2; exit 1; }; }

# From the sample to its volume.  use PROGRAM
use() {
  "$1" doctor
  "$1" sample -o "$work/capture" --progress plain
  "$1" run "$work/capture" -o "$work/run" --preset quick --progress plain
  ls -l "$work"/run/bakes/*/volume.vdb
}

# A run of the earlier package, opened, coloured and baked by the later one.
upgrade() {
  quietly install "$earlier"
  cnerf --version
  cnerf sample -o "$work/old-capture" --progress quiet
  cnerf run "$work/old-capture" -o "$work/old-run" --preset quick --set stage1.steps=300 --progress quiet
  quietly install "$package"
  cnerf --version
  cnerf info "$work/old-run"
  cnerf eval "$work/old-run" --progress quiet
  cnerf bake "$work/old-run" -o "$work/new-bake" --progress quiet
  cnerf colorize "$work/old-run" --take new --colorizer builtin --progress quiet
  ls -l "$work"/old-run/bakes/*/volume.vdb "$work/new-bake/volume.vdb"
}

remove() {
  # Also what apt keeps because something that was there before merely suggests it.
  quietly purge --autoremove -o APT::AutoRemove::SuggestsImportant=false -o APT::AutoRemove::RecommendsImportant=false cnerf
  # Debian 13's apt keeps adduser, since one of its own needs is "base-passwd | adduser".
  if [ "$(packages | comm -13 "$work/packages_before" - | cut -d ' ' -f 1)" = adduser ]; then
    echo "kept by apt as an alternative of what was there before: adduser"
    quietly purge adduser
  fi
  list_files > "$work/files_after"
  packages > "$work/packages_after"
  diff "$work/packages_before" "$work/packages_after" && echo "purged: the same packages as before"
  comm -13 "$work/files_before" "$work/files_after" > "$work/left"
  echo "files that were not there before: $(wc -l < "$work/left")"
  [ ! -s "$work/left" ] || { head -n 20 "$work/left" >&2; exit 1; }
}

try_package() {
  apt-get update -qq
  list_files > "$work/files_before"
  packages > "$work/packages_before"
  if [ -n "$earlier" ]; then
    upgrade
  else
    echo "install with download:" && time quietly install "$package"
    echo "$(($(packages | wc -l) - $(wc -l < "$work/packages_before"))) packages"
    echo "from the sample to the end of the run:" && time use cnerf
  fi
  remove
}

case $package in
  *.deb) try_package ;;
  *)
    tar -xzf "$package" -C "$work"
    use "$work"/cnerf-*/bin/cnerf
    ;;
esac
