#!/usr/bin/env bash
# Cross-builds for arm64 the libraries that do without LibTorch, with their tests, and runs these under qemu-user.
#   bash scripts/cross_arm64.sh [ctest options]
# It installs arm64's libraries, which may take the place of this machine's: for a root of its own, which
# scripts/try_debian.sh 12 arm64 makes.
set -euo pipefail
cd "$(dirname "$0")/.."
[ "$(dpkg --print-architecture)" = amd64 ] || { echo "$0: cross-builds from amd64" >&2; exit 69; }
tools=(cmake ninja-build ccache pkg-config g++ crossbuild-essential-arm64 qemu-user gzip
  libcli11-dev nlohmann-json3-dev)
libraries=(libopenvdb-dev libboost-iostreams-dev libnanovdb-dev libopencv-dev libopenexr-dev libtinygltf-dev
  libmeshoptimizer-dev libceres-dev libexif-dev libpugixml-dev libtomlplusplus-dev libfmt-dev libspdlog-dev libtbb-dev libssl-dev
  zlib1g-dev libcpp-httplib-dev libgtest-dev libgmock-dev libbenchmark-dev)
tests=(base_test color_test picture_test capture_test sample_test encoding_test optim_test field_test render_test engine_test
  cnerf-backend-ops bake_test export_test config_test viewer_test)
programs=(cnerf-vdb-reader)  # which tests start

dpkg --add-architecture arm64
apt-get update -qq
DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${tools[@]}" "${libraries[@]/%/:arm64}"
cmake --preset arm64
cmake --build --preset arm64 --target "${tests[@]}" "${programs[@]}"
# RunProgram asks for the error of a program that is not there, which posix_spawn does not give under qemu-user.
ctest --preset arm64 -E '^base_test.RunProgram$' -R "^($(IFS='|' && echo "${tests[*]}"))\\." "$@"
