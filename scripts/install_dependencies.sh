#!/usr/bin/env bash
# Installs the Debian packages that building and testing need, those that are missing only.
#   bash scripts/install_dependencies.sh           to build and run
#   bash scripts/install_dependencies.sh --tests   also what tests look at results with
set -euo pipefail

packages=(
  cmake ninja-build g++ pkg-config ccache
  libtorch-dev
  libopenblas0-pthread  # without it LibTorch falls back to the reference BLAS, which is many times slower
  libopenvdb-dev libboost-iostreams-dev libopenvdb-tools libnanovdb-dev
  libopencv-dev libopenexr-dev libtinygltf-dev libmeshoptimizer-dev
  libexif-dev colmap
  libcli11-dev libtomlplusplus-dev nlohmann-json3-dev libpugixml-dev libfmt-dev libspdlog-dev
  libtbb-dev libssl-dev zlib1g-dev libcpp-httplib-dev
  libgtest-dev libgmock-dev libbenchmark-dev
)
command -v npm > /dev/null || packages+=(nodejs npm)  # for the viewer's page; a node from elsewhere will do
if [[ "${1:-}" == "--tests" ]]; then
  packages+=(blender python3-numpy chromium)
fi

# Installs those of "${packages[@]}" that are missing.
install_packages() {
  local missing=() as_root=() package
  for package in "${packages[@]}"; do
    if [[ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2> /dev/null)" != installed ]]; then
      missing+=("$package")
    fi
  done
  if [[ ${#missing[@]} -eq 0 ]]; then
    echo "dependencies: all there"
    return
  fi
  if [[ $EUID -ne 0 ]]; then
    command -v sudo > /dev/null || { echo "need root to install: ${missing[*]}" >&2; exit 1; }
    as_root=(sudo)
  fi
  echo "dependencies: installing ${missing[*]}"
  "${as_root[@]}" apt-get update -qq
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"
}

# Khronos' glTF validator, which Debian does not package. Tests that need it skip where it cannot be had.
install_gltf_validator() {
  local folder
  folder="$(dirname "$0")/../build/node"
  [[ -d "$folder/node_modules/gltf-validator" ]] && return
  if ! command -v npm > /dev/null; then
    echo "dependencies: no npm, so no glTF validator; its tests will skip"
    return
  fi
  mkdir -p "$folder"
  npm install --prefix "$folder" --no-save --no-fund --no-audit --loglevel=error gltf-validator@2.0.0-dev.3.10 ||
    echo "dependencies: npm cannot get the glTF validator; its tests will skip"
}

# What the viewer's page is built with: Vite, TypeScript; nothing of it is part of the page.
install_page_packages() {
  local folder
  folder="$(dirname "$0")/../viewer"
  [[ "$folder/node_modules/.package-lock.json" -nt "$folder/package-lock.json" ]] && return
  if ! command -v npm > /dev/null; then
    echo "dependencies: no npm, so the viewer's page is not built"
    return
  fi
  npm ci --prefix "$folder" --fetch-retries=1 --fetch-timeout=60000 --no-fund --no-audit --loglevel=error ||
    echo "dependencies: npm cannot get the packages of the viewer's page; it is not built"
}

install_packages
install_page_packages
if [[ "${1:-}" == "--tests" ]]; then install_gltf_validator; fi
