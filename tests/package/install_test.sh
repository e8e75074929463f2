#!/usr/bin/env bash
# install_test.sh BUILD FOLDER PYTHON: installs BUILD below FOLDER, moves it, and uses it there.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
build=$1
folder=$2/installed
interpreter=$3  # that the module is built for
fail() { echo "$1" >&2; exit 1; }

rm -rf "$folder" "$folder-moved"
cmake --install "$build" --prefix "$folder" > /dev/null
mv "$folder" "$folder-moved"  # whatever names its first place is found out
folder=$folder-moved

"$folder/bin/cnerf" doctor > "$folder/doctor.txt"
grep -q "presets:.* in $folder/share/cnerf/configs" "$folder/doctor.txt" || fail "presets are not the installed ones"
grep -q 'LibTorch: *[0-9]' "$folder/doctor.txt" || fail "the plug-in with LibTorch is not loaded"
"$folder/bin/cnerf" colorize-image "$here/../../docs/images/viewer.png" "$folder/coloured.png" --short-side 32 > "$folder/colorizer.txt"
grep -q '^coloured by builtin:' "$folder/colorizer.txt" || fail "the built-in colorizer has no weights"
for file in share/man/man1/cnerf.1.gz share/man/man1/cnerf-bake.1.gz share/bash-completion/completions/cnerf \
  share/cnerf/colorizer.weights share/doc/cnerf/copyright lib/cnerf/cnerf-vdb-reader; do
  [ -s "$folder/$file" ] || fail "$file is not installed"
done
# What a library with a RUNPATH loads does not look there, and the archive brings libraries that load others.
for file in "$folder"/lib/cnerf/libcnerf_*.so "$folder"/lib/python3/dist-packages/cnerf/*.so; do
  [ -e "$file" ] || continue
  if readelf -d "$file" | grep -F '(RUNPATH)' > /dev/null; then fail "$file has a RUNPATH"; fi
done
# The module finds the installation that it is part of.
python=$folder/lib/python3/dist-packages
if [ -d "$python/cnerf" ]; then
  PYTHONPATH=$python "$interpreter" - "$folder" << 'END' || fail "the Python module does not work where it is installed"
import pathlib, sys
import cnerf
assert pathlib.Path(cnerf.__file__).is_relative_to(sys.argv[1]), cnerf.__file__
try:
    cnerf.train("none", "nowhere", preset="no-such-preset")
except cnerf.UsageError as error:
    assert "quick" in str(error), error
END
fi
if command -v man > /dev/null; then
  # The commands as text; a page that man complains of is none.
  complaints=$(man --warnings -l "$folder/share/man/man1/cnerf-bake.1.gz" 2>&1 > "$folder/page.txt")
  [ -z "$complaints" ] || fail "man: $complaints"
  grep -qe '--resolution' "$folder/page.txt" || fail "cnerf-bake(1) lacks --resolution"
fi

# Errors are red on a terminal, unless NO_COLOR asks for none. A bare root may have no terminals.
red=$'\x1b[31mcnerf: '
on_terminal() { script -qec "$1" /dev/null || true; }
if [ -c /dev/pts/ptmx ] && ! grep -qF "$red" <<< "$(NO_COLOR='' on_terminal "$folder/bin/cnerf docter")"; then
  fail "an error on a terminal is not red"
fi
if grep -qF $'\x1b' <<< "$(NO_COLOR=1 on_terminal "$folder/bin/cnerf docter")"; then fail "NO_COLOR is not honoured"; fi

cmake -S "$here/consumer" -B "$folder/consumer" -DCMAKE_PREFIX_PATH="$folder" > "$folder/configure.txt" ||
  { cat "$folder/configure.txt"; fail "find_package(cnerf) fails"; }
cmake --build "$folder/consumer" > "$folder/build.txt" 2>&1 || { tail -n 30 "$folder/build.txt"; fail "it does not build"; }
status=0
"$folder/consumer/pipeline_example" || status=$?
[ "$status" -eq 64 ] || fail "the built program ends with $status, where 64 says how to call it"
rm -rf "$folder"
