#!/usr/bin/env bash
# Builds the Debian package of an earlier commit that had none, to upgrade from it: today's scripts/package.sh in the
# sources of that commit, with what it reads of today laid beside the commit's own rules of installation.
#   bash scripts/package_earlier.sh COMMIT      the package comes to build/package/earlier
set -euo pipefail
cd "$(dirname "$0")/.."
commit=${1:?$(sed -n '2,4p' "$0")}
tree=build/earlier-$commit
mkdir -p "$tree" build/package/earlier
git archive "$commit" | tar -x -C "$tree"

today=(CHANGELOG.md CMakePresets.json scripts/package.sh scripts/bill_of_materials.pl scripts/install_dependencies.sh
  cmake/packages.cmake cmake/package_kinds.cmake cmake/debian_copyright cmake/lintian_overrides)
tar -c "${today[@]}" | tar -x -C "$tree"
sed -i 's/^include(cmake\/toolchain.cmake)/set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME program)\n&/' "$tree/CMakeLists.txt"
cat >> "$tree/CMakeLists.txt" << 'END'
if(NOT TARGET cnerf-vdb-reader)
  add_executable(cnerf-vdb-reader ALIAS cnerf)  # packages.cmake names it
endif()
include(cmake/packages.cmake)
END
mkdir -p "$tree/build/package/share/cnerf" && ln -sfn ../../viewer/page "$tree/build/package/share/cnerf/viewer"  # where it is looked for
# The script may end with an error once packages stand: a program of then names the folder it was built in.
(cd "$tree" && CNERF_CUDA=OFF bash scripts/package.sh deb) || true
cp "$tree"/build/package/packages/cnerf_*.deb build/package/earlier/
ls -l build/package/earlier
