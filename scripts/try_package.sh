#!/usr/bin/env bash
# Installs cnerf's package on a Debian that has nothing of it, uses it, purges it and looks for what is left.
# scripts/try_debian.sh runs it in a bare root; it needs root, and changes the system it runs on.
#   bash scripts/try_package.sh CNERF.deb
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

apt-get update -qq
list_files > "$work/files_before"
packages > "$work/packages_before"

begin=$SECONDS
apt-get install -y -qq "$package" > "$work/install.log" 2>&1 || { tail -n 20 "$work/install.log" >&2; exit 1; }
installed=$SECONDS
echo "installed: $(($(packages | wc -l) - $(wc -l < "$work/packages_before"))) packages in $((installed - begin)) s"
cnerf doctor
cd "$work"
cnerf sample -o capture --progress plain
cnerf run capture -o run --preset quick --progress plain
ls -l run/bakes/*/volume.vdb
echo "from apt to the volume: $((SECONDS - begin)) s, of which apt took $((installed - begin)) s"
cd /

apt-get purge -y -qq --autoremove cnerf > "$work/purge.log" 2>&1 || { tail -n 20 "$work/purge.log" >&2; exit 1; }
list_files > "$work/files_after"
packages > "$work/packages_after"
diff "$work/packages_before" "$work/packages_after" && echo "purged: the same packages as before"
# What packages of others make at their installation and leave is listed; a file of cnerf's fails.
comm -13 "$work/files_before" "$work/files_after" > "$work/left"
echo "files that were not there before: $(wc -l < "$work/left")"
head -n 20 "$work/left"
if grep -i cnerf "$work/left"; then
  echo "try_package: the above is left of cnerf" >&2
  exit 1
fi
