#!/usr/bin/env bash
# Checks the documents; CTest runs each part under the label docs.
#   bash scripts/docs.sh [reference|spelling|links]...    without a name: all of them
# reference: Doxygen makes build/api/html from the headers, and a warning is an error. spelling: codespell over prose and
# comments. links: every relative link and anchor in Markdown leads somewhere. Exit code 77: its program is missing.
set -euo pipefail
cd "$(dirname "$0")/.."

need() {
  command -v "$1" > /dev/null && return
  echo "docs: $1 is missing; scripts/install_dependencies.sh --tests installs it"
  exit 77
}
# Git's list, or in an unpacked archive what lies there.
files() {
  git ls-files -z -- "$@" 2> /dev/null ||
    find . -type f -regex '.*\.\(md\|h\|cpp\|cu\|cuh\|inl\|py\|ts\|sh\|toml\)' ! -path '*/node_modules/*' ! -path './build/*' -print0
}

check_reference() {
  need doxygen
  mkdir -p build/api
  (cat docs/Doxyfile && echo "WARN_AS_ERROR = FAIL_ON_WARNINGS") | doxygen -
  echo "docs: reference in build/api/html/index.html"
}
check_spelling() {
  need codespell
  # What is meant: names, words misspelled on purpose by tests, "to and fro", and what one version or the other does not
  # know.
  files '*.md' '*.h' '*.cpp' '*.cu' '*.cuh' '*.inl' '*.py' '*.ts' '*.sh' '*.toml' |
    xargs -0 codespell --ignore-words-list inflight,trian,siez,fro,halfs,fo,qick,lins,fillin,shepperd,regrading,regraded,caf
  echo "docs: spelling is clean"
}
check_links() {
  need python3
  python3 scripts/check_links.py
}

for part in "${@:-reference spelling links}"; do
  for name in $part; do "check_$name"; done
done
