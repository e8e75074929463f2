#!/usr/bin/env bash
# Disturbs the built program: failing, short and cut-off writes, power cuts, kills, two programs in one folder, no memory.
#   bash scripts/faults.sh [--full]     about 3 minutes; in full, hours
# Prints a table per campaign and fails where anything was violated; what was is kept in $FOLDER.
# PROGRAM=path disturbs another cnerf, FOLDER=path works elsewhere, SEED=n draws otherwise. PATIENCE=s is how long a
# program may take [180]; a busy machine needs more.
set -uo pipefail
cd "$(dirname "$0")/.."
campaign=build/release/cnerf-fault-campaign
options=(--folder "${FOLDER:-build/faults}" --seed "${SEED:-1}" --patience "${PATIENCE:-180}" -j 2)
if [ -n "${PROGRAM:-}" ]; then options+=(--program "$PROGRAM"); fi
failures=0
run() { "$campaign" "$@" "${options[@]}" || failures=$((failures + 1)); }

if [ "${1:-}" = --full ]; then
  run operations
  run kills --count 500
  run pairs --count 200
  run allocations --every 10
else
  run operations --commands sample,train,colorize,bake,web,eval --every 12
  run kills --count 18 --commands train,colorize,bake
  run pairs --count 12 --commands colorize,bake,bake-smaller,web,info
  run allocations --commands info,bake,train,render --every 40
fi
exit $((failures > 0))
