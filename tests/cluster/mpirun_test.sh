#!/usr/bin/env bash
# Two ranks by Open MPI's mpirun: the same run as two by hand.  mpirun_test.sh CNERF FOLDER
. "$(dirname "$0")/common.sh"
need mpirun
root=()
if [ "$(id -u)" = 0 ]; then root=(--allow-run-as-root); fi
mapfile -d '' -t words < <(run_words "$work/mpi")
mpirun "${root[@]}" --oversubscribe -np 2 "${words[@]}" > "$work/mpi.log" 2>&1 || fail "$(cat "$work/mpi.log")"
by_hand "$work/hand"
same_run "$work/hand" "$work/mpi"
# One rank of one is a program alone.
mpirun "${root[@]}" -np 1 "$cnerf" train "$capture" -o "$work/one" "${settings[@]}" > "$work/one.log" 2>&1 ||
  fail "$(cat "$work/one.log")"
"$cnerf" train "$capture" -o "$work/alone" "${settings[@]}" > "$work/alone.log"
cmp "$work/one/stage1.snapshot" "$work/alone/stage1.snapshot" || fail "one rank is not what a program alone is"
