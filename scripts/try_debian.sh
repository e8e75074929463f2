#!/usr/bin/env bash
# Tries the project on a bare Debian: makes a root with debootstrap, copies what git tracks of HEAD into it, and runs set-up,
# demo and tests there. Prints a row of CONTRIBUTING's table. Needs root, debootstrap, and 20 GB in $ROOTS (/var/tmp).
#   scripts/try_debian.sh 12|13 [packages|demo|tests]...      stages to run; demo and tests if not given
# Each stage begins with scripts/install_dependencies.sh, apt included. $CNERF_DATA, if set, is mounted read-only for the
# tests. The root stays, so that a later call goes on in it; FRESH=1 makes it anew.
#   scripts/try_debian.sh 12|13 build      builds the packages in the root, by scripts/package.sh, into build/package/packages
#   scripts/try_debian.sh 12|13 blender    the tests with Blender alone
# These have roots of their own:
#   scripts/try_debian.sh 12|13 package|archive      takes what scripts/package.sh built for that Debian to a root that has
#                                                    nothing else, runs the sample to a volume and removes it
#   scripts/try_debian.sh 12|13 upgrade    the same from the package in build/package/earlier (scripts/package_earlier.sh)
#   scripts/try_debian.sh 12|13 arm64      cross-builds for arm64 and tests under qemu-user, by scripts/cross_arm64.sh
set -euo pipefail
cd "$(dirname "$0")/.."

release=${1:-}
case $release in
  12) suite=bookworm ;;
  13) suite=trixie ;;
  *) sed -n '2,14p' "$0" >&2; exit 64 ;;
esac
shift
stages=("$@")
if [ ${#stages[@]} -eq 0 ]; then stages=(demo tests); fi
[ "$EUID" -eq 0 ] || { echo "$0: needs root for chroot and mount" >&2; exit 77; }

root=${ROOTS:-/var/tmp}/cnerf-debian-$release
case ${stages[*]} in
  package | archive | upgrade) root+=-package ;;  # where nothing is installed that building needs
  arm64) root+=-arm64 ;;                          # where libraries are another machine's
esac
tree=/home/cnerf
mounts=()
release_mounts() {
  local folder
  for folder in "${mounts[@]}"; do umount -l "$folder" || true; done  # the last one first
}
trap release_mounts EXIT

mount_in() {  # mount_in FOLDER mount-options...
  mkdir -p "$root$1"
  mount "${@:2}" "$root$1"
  mounts=("$root$1" "${mounts[@]}")
}

make_root() {
  debootstrap --variant=minbase --include=ca-certificates "$suite" "$root" http://deb.debian.org/debian > "$root.log"
  # Security updates, where libraries that Debian rebuilds are kept.
  echo "deb http://deb.debian.org/debian-security $suite-security main" > "$root/etc/apt/sources.list.d/security.list"
  printf '127.0.0.1 localhost\n127.0.1.1 %s\n' "$(hostname)" > "$root/etc/hosts"  # as an installer does
  printf '#!/bin/sh\nexit 101\n' > "$root/usr/sbin/policy-rc.d"  # no services are started in here
  chmod +x "$root/usr/sbin/policy-rc.d"
  # Certificates that this machine trusts beyond Debian's.
  cp /usr/local/share/ca-certificates/*.crt "$root/usr/local/share/ca-certificates/" 2> /dev/null || true
  chroot "$root" update-ca-certificates > /dev/null
}

# Runs a command in the tree of the root; what it prints goes to ROOT-NAME.log.  inside NAME command...
inside() {
  local name=$1
  shift
  local environment=(HOME=/root LANG=C.UTF-8 PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
    NODE_EXTRA_CA_CERTS=/etc/ssl/certs/ca-certificates.crt)
  if [ -n "${CNERF_DATA:-}" ]; then environment+=(CNERF_DATA=/data); fi
  chroot "$root" env -i "${environment[@]}" bash -c "cd $tree && exec \"\$@\"" - "$@" > "$root-$name.log" 2>&1
}

as_minutes() { printf '%d min %02d s' $(($1 / 60)) $(($1 % 60)); }

if [ "${FRESH:-0}" = 1 ]; then rm -rf --one-file-system "$root"; fi
if [ ! -e "$root/usr/sbin/policy-rc.d" ]; then make_root; fi
cp /etc/resolv.conf "$root/etc/resolv.conf"
mount_in "" --bind "$root"  # so that "/" in there is a mount point, as for network namespaces it has to be
mount_in /proc -t proc proc
mount_in /dev --bind /dev
mount_in /dev/pts --bind /dev/pts
mount_in /sys --rbind --make-rslave /sys  # cgroups too, for slurmd
mount_in /dev/shm -t tmpfs tmpfs  # for Chromium
if [ -n "${CNERF_DATA:-}" ]; then mount_in /data --bind -o ro "$CNERF_DATA"; fi
rm -rf "${root:?}$tree"
mkdir -p "$root$tree"
git archive HEAD | tar -x -C "$root$tree"

case ${stages[*]} in
  package | upgrade) built=$(ls build/package/packages/cnerf_*~deb"$release"_*.deb 2> /dev/null || true) ;;
  archive) built=$(ls build/package/packages/cnerf-*.tar.gz 2> /dev/null || true) ;;
  *) built= ;;
esac
if [[ $root == *-package ]]; then
  [ -e "$built" ] || { echo "$0: nothing built for Debian $release; run scripts/package.sh on it" >&2; exit 66; }
  cp "$built" "$root$tree/"
  case ${stages[*]} in upgrade) mkdir "$root$tree/earlier" && cp build/package/earlier/cnerf_*~deb"$release"_*.deb "$root$tree/earlier/" ;; esac
fi

declare -A outcome=([packages]=- [demo]=- [tests]=-)
failures=0
for stage in "${stages[@]}"; do
  case $stage in
    packages) command=(bash scripts/install_dependencies.sh) ;;
    demo) command=(bash scripts/demo.sh) ;;
    tests) command=(bash scripts/test.sh) ;;
    build) command=(bash scripts/package.sh deb) ;;
    blender) command=(env TARGETS=blender_test bash scripts/test.sh -L blender) ;;
    arm64) command=(bash scripts/cross_arm64.sh) ;;
    package | archive) command=(bash scripts/try_package.sh "$(basename "$built")") ;;
    upgrade) command=(bash -c "bash scripts/try_package.sh '$(basename "$built")' earlier/*.deb") ;;
    *) echo "$0: no stage '$stage'" >&2; exit 64 ;;
  esac
  begin=$SECONDS
  verdict=passes
  inside "$stage" "${command[@]}" || { verdict=FAILS; failures=1; }
  outcome[$stage]="$verdict, $(as_minutes $((SECONDS - begin)))"
  echo "Debian $release: $stage ${outcome[$stage]}; $root-$stage.log" >&2
  tail -n 4 "$root-$stage.log" >&2
  if [ "$stage" = build ] && [ "$verdict" = passes ]; then
    mkdir -p build/package/packages
    cp "$root$tree"/build/package/packages/*.deb build/package/packages/
  fi
done
if [[ $root == *-@(package|arm64) ]]; then exit $failures; fi

version_of() { chroot "$root" dpkg-query -W -f '${Version}' "$1" 2> /dev/null | sed 's/^[0-9]*://; s/[-+~].*//' || true; }
echo "| Debian | g++ | CMake | LibTorch | OpenCV | COLMAP | Blender | node | packages | demo | tests |"
echo "|---|---|---|---|---|---|---|---|---|---|---|"
printf '| %s |' "$release" "$(version_of g++)" "$(version_of cmake)" "$(version_of libtorch-dev)" "$(version_of libopencv-dev)" \
  "$(version_of colmap)" "$(version_of blender)" "$(version_of nodejs)" "${outcome[packages]}" "${outcome[demo]}" "${outcome[tests]}" |
  sed 's/||/|/g'
echo
exit $failures
