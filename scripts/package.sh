#!/usr/bin/env bash
# Builds the packages of this machine's Debian into build/package/packages:
#   cnerf, libcnerf-dev and python3-cnerf (.deb), an archive with the shared libraries (.tar.gz), a bill of materials (SPDX), SHA256SUMS.
#   bash scripts/package.sh [deb] [archive]     both if none is named
set -euo pipefail
cd "$(dirname "$0")/.."
build=build/package
packages=$build/packages
kinds=("$@")
if [ ${#kinds[@]} -eq 0 ]; then kinds=(deb archive); fi
for kind in "${kinds[@]}"; do
  case $kind in deb | archive) ;; *) sed -n '2,4p' "$0" >&2; exit 64 ;; esac
done

bash scripts/install_dependencies.sh
cuda=OFF
if nvcc --version 2> /dev/null | grep -E 'release (1[2-9]|[2-9][0-9])\.' > /dev/null; then cuda=ON; fi  # which know C++20
cmake --preset package -DCNERF_CUDA="${CNERF_CUDA:-$cuda}"
# The folder may hold the page of an earlier build.
if ! grep -qx 'CNERF_HAS_PAGE:INTERNAL=ON' "$build/CMakeCache.txt"; then
  echo "package: the page cannot be built; it wants npm" >&2
  exit 69
fi
cmake --build --preset package

# A package runs on every x86-64 and names no folder of the machine that built it.
if grep -qE -- '-m(arch|tune)=native' "$build/compile_commands.json"; then
  echo "package: compiled for this machine's processor only" >&2
  exit 70
fi
rm -rf "$packages"
for kind in "${kinds[@]}"; do
  case $kind in
    deb) cpack --config "$build/CPackConfig.cmake" -G DEB ;;
    archive) cpack --config "$build/CPackConfig.cmake" -G TGZ ;;
  esac
done
rm -rf "$packages/_CPack_Packages"
for file in "$build"/cnerf "$build"/cnerf-vdb-reader "$build"/libcnerf_*.so "$build"/python/cnerf/*.so; do
  if strings "$file" | grep -F "$PWD/" > "$build/own_folder.txt"; then
    echo "package: $file names this folder: $(head -n 1 "$build/own_folder.txt")" >&2
    exit 70
  fi
done
perl scripts/bill_of_materials.pl "$build"/cnerf "$build"/cnerf-vdb-reader "$build"/libcnerf_*.so > "$packages/cnerf.spdx.json"
(cd "$packages" && LC_ALL=C sha256sum -- *.* > SHA256SUMS)
ls -l "$packages"
